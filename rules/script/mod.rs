//! What the integrator decides: the rhai host.
