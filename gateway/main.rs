//! `cnc-gateway`: parses the arguments and calls one function.

fn main() {}
