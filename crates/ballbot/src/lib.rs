//! The ballbot plant.
#![no_std]
