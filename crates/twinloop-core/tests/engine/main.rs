//! The engine through its public face, held against computations that share no code with it.

mod cmaes;
mod controllers;
mod dense;
mod flights;
mod grammar;
mod integrator;
mod lanes;
mod model_search;
mod models;
mod objectives;
mod oracle;
mod programs;
mod quadrotor;
mod regression;
mod rollouts;
mod selected_tests;
mod test_search;
mod text;
mod tuning;
mod worlds;
