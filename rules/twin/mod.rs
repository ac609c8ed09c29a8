//! What is doubted: simulate, compare, locate, name, refit, report.
