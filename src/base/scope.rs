//! What one call asks for: threads and a mode of its own, whatever the process is set to.
//!
//! Two tasks of one process may ask for different modes at once, so a mode cannot be the process's.
//! It belongs to the thread of the call, and to a thread of the pool as long as it works for that
//! call. The process's settings stand where a call asks for nothing.

use std::cell::Cell;

/// What a call asks for; None leaves it to the process.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Scope {
    pub threads: Option<usize>,
    /// Whether all levels of vector instructions give the same bits.
    pub reproducible: Option<bool>,
}

thread_local! {
    static SCOPE: Cell<Scope> = const { Cell::new(Scope { threads: None, reproducible: None }) };
}

impl Scope {
    pub fn now() -> Self {
        SCOPE.get()
    }

    /// Makes it this thread's until the guard is dropped.
    #[must_use]
    pub fn enter(self) -> Entered {
        Entered(SCOPE.replace(self))
    }

    /// Makes it this thread's; returns what was.
    pub fn swap(self) -> Self {
        SCOPE.replace(self)
    }
}

/// Gives a thread back what it had before.
pub struct Entered(Scope);

impl Drop for Entered {
    fn drop(&mut self) {
        SCOPE.set(self.0);
    }
}
