//! The plane: crossed strings against formulas, closed rows, and the links that follow motion against
//! links built anew.

mod motion;
mod orders;
mod strings;
