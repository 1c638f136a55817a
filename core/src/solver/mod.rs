//! Time stepping, and certificates that are computed before the first step.

pub mod stepping;
pub mod certificate;
