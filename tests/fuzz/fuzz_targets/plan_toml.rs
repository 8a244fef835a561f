//! Any text as a plan, read both as the plan of a file and as a new one: all its errors, and its
//! cells if there are not too many.
#![no_main]

use jointrig::campaign::plan::Plan;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let read = Plan::parse(text, "plan.toml");
    let strict = Plan::parse_new(text, "plan.toml");
    assert!(read.is_ok() || strict.is_err(), "a new plan is held to more, not to less");
    let all = Plan::parse_all(text, "plan.toml");
    assert!(all.as_ref().err().is_none_or(|errors| !errors.is_empty() && errors.iter().all(|error| !error.to_string().is_empty())));
    if let Ok(plan) = read {
        drop(plan.hits_wanted());
    }
});
