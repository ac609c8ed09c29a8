-- Compiling a question takes seconds and running it milliseconds: with few rows nobody has counted them, and the planner expects many. Needs
-- the owner of the database; of other users `ALTER DATABASE NAME SET jit = off` by hand.
DO $$ BEGIN
  EXECUTE format('ALTER DATABASE %I SET jit = off', current_database());
EXCEPTION WHEN insufficient_privilege THEN RAISE NOTICE 'jit stays on: questions may take seconds longer';
END $$;
