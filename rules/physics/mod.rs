//! What is known: one physical effect per file.
