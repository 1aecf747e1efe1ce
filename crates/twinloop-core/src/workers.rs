//! Workers: how work is carried out, never what comes out.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use crate::controller::Family;
use crate::error::{Result, invalid};
use crate::lanes::Width;

/// Threads and the vector width that they use.
pub struct Workers {
    /// None for one thread, which is that of the caller.
    pool: Option<rayon::ThreadPool>,
    width: Width,
}

impl Workers {
    /// As many threads as asked for.
    pub fn new(threads: usize, width: Width) -> Result<Self> {
        if threads == 0 || threads > 1024 {
            return invalid(format!("threads: expected 1 to 1024, found {threads}"));
        }
        if threads == 1 {
            return Ok(Self { pool: None, width });
        }
        match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
            Ok(pool) => Ok(Self { pool: Some(pool), width }),
            Err(error) => invalid(format!("threads: could not start {threads}: {error}")),
        }
    }

    /// Number of threads.
    pub fn threads(&self) -> usize {
        self.pool.as_ref().map_or(1, rayon::ThreadPool::current_num_threads)
    }

    /// The vector width.
    pub fn width(&self) -> Width {
        self.width
    }

    /// `work` of each index, in the order of the indices whoever did it.
    pub fn map<T: Send>(&self, count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
        let Some(pool) = self.pool.as_ref().filter(|_| count > 1) else {
            return (0..count).map(work).collect();
        };
        let found: Vec<_> = (0..count).map(|_| Mutex::new(None)).collect();
        shared(pool, count, &|i| {
            let value = work(i);
            *found[i].lock().unwrap_or_else(PoisonError::into_inner) = Some(value);
        });
        let value = |one: Mutex<Option<T>>| one.into_inner().unwrap_or_else(PoisonError::into_inner);
        found.into_iter().map(|one| value(one).expect("work for each index")).collect()
    }

    /// The same for work that flies controllers of a family: on this thread alone where its law is outside of the engine.
    pub(crate) fn map_flights<T: Send>(
        &self,
        family: &Family,
        count: usize,
        work: impl Fn(usize) -> T + Sync,
    ) -> Vec<T> {
        if family.is_foreign() { (0..count).map(work).collect() } else { self.map(count, work) }
    }
}

/// Each index, by many threads. By a pointer: else all that shares out work is compiled again for each kind of it.
fn shared(pool: &rayon::ThreadPool, count: usize, work: &(dyn Fn(usize) + Sync)) {
    pool.install(|| (0..count).into_par_iter().for_each(work));
}
