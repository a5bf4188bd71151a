//! How a command ends.

use std::process::ExitCode;

/// Wrong usage that the argument parser cannot see; exit status 2.
#[derive(Debug)]
pub struct Usage(pub String);

impl std::fmt::Display for Usage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Usage {}

/// A log that cannot be opened by these flags: a topic that must be chosen or is not there, and a value out of range, are wrong usage.
pub fn as_usage(error: net_log::Error) -> anyhow::Error {
    match error {
        net_log::Error::Value { field, value, expected } => Usage(format!("--{field} is {value}: {expected}")).into(),
        net_log::Error::SeveralTopics { .. } | net_log::Error::NoSuchTopic { .. } => Usage(error.to_string()).into(),
        other => other.into(),
    }
}

/// What a finished command says of its input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// All of it was read.
    Complete,
    /// Results stand, but a frame could not be read, or the command was stopped: exit status 1.
    Partial,
}

/// Prints an error once, with all its causes, and chooses the exit status.
pub fn exit_code(done: anyhow::Result<Outcome>) -> ExitCode {
    match done {
        Ok(Outcome::Complete) => ExitCode::SUCCESS,
        Ok(Outcome::Partial) => ExitCode::FAILURE,
        // The reader of our output has gone (`netpose ... | head`): nobody is left to be told.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", text(&error));
            if error.is::<Usage>() { ExitCode::from(2) } else { ExitCode::FAILURE }
        }
    }
}

/// The error with its causes, each said once: some repeat their cause in their own words.
fn text(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |said, cause| match said.as_str() {
        "" => cause,
        earlier if earlier.contains(&cause) => said,
        earlier => format!("{earlier}: {cause}"),
    })
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}

#[cfg(test)]
mod tests {
    use anyhow::Context;

    use super::*;

    #[test]
    fn every_cause_is_said_once() {
        let missing = || std::io::Error::from(std::io::ErrorKind::NotFound);
        let error = anyhow::Error::from(missing()).context("cannot read a.yaml").context("--camera");
        assert_eq!(text(&error), format!("--camera: cannot read a.yaml: {}", missing()));
        let repeated = net_log::read_camera("no/such/file".as_ref()).context("--camera").unwrap_err();
        assert_eq!(text(&repeated).matches("os error").count(), 1, "{}", text(&repeated));
    }
}
