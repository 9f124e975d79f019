//! The thread that writes batches: each until the database has it, or refuses it for what it is.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::{Context as _, Result};
use ureq::Agent;

use super::queue::{Batch, Queue};
use super::target::Target;

/// A database that has not answered by then will not.
const LIMIT: Duration = Duration::from_secs(10);
/// The first wait after a failure, which doubles up to the longest.
const WAIT_MIN: Duration = Duration::from_millis(200);
const WAIT_MAX: Duration = Duration::from_secs(5);
/// What is read of an answer.
const ANSWER_BYTES_MAX: u64 = 2_048;
/// What is told of it.
const WORDS_MAX: usize = 200;

/// How a batch went.
enum Answer {
    Taken,
    /// For what it is: another try would end alike.
    Refused(String),
    /// There is no such database.
    Missing(String),
    /// The server is away, busy, or wants another token.
    Away(String),
}

/// Starts the thread; it ends when the queue is closed and empty, or its time is up.
pub fn start(target: Target, queue: Arc<Queue>) -> Result<JoinHandle<()>> {
    let config = Agent::config_builder().timeout_global(Some(LIMIT)).http_status_as_error(false);
    let agent: Agent = config.build().into();
    let thread = std::thread::Builder::new().name("influx".to_owned());
    thread.spawn(move || write_all(&agent, &target, &queue)).context("--influx: no thread")
}

fn write_all(agent: &Agent, target: &Target, queue: &Queue) {
    while let Some(batch) = queue.take() {
        let mut wait = WAIT_MIN;
        let refused = loop {
            let why = match write(agent, target, &batch) {
                Answer::Taken => break None,
                Answer::Refused(why) => break Some(why),
                Answer::Missing(why) => {
                    create(agent, target);
                    why
                }
                Answer::Away(why) => why,
            };
            if !queue.trouble(why, wait) {
                // What is in hand stays counted as waiting.
                return;
            }
            wait = (wait * 2).min(WAIT_MAX);
        };
        queue.done(&batch, refused);
    }
}

fn write(agent: &Agent, target: &Target, batch: &Batch) -> Answer {
    let mut request = agent.post(&target.write).content_type("text/plain; charset=utf-8");
    if let Some(authorization) = &target.authorization {
        request = request.header("Authorization", authorization);
    }
    let mut response = match request.send(&batch.text[..]) {
        Ok(response) => response,
        Err(error) => return Answer::Away(error.to_string()),
    };
    let status = response.status().as_u16();
    if (200..300).contains(&status) {
        return Answer::Taken;
    }
    let body = response.body_mut().with_config().limit(ANSWER_BYTES_MAX).read_to_string();
    let words: String = body.unwrap_or_default().chars().take(WORDS_MAX).collect();
    let why = format!("the database answers {status}: {}", words.trim());
    match status {
        404 => Answer::Missing(why),
        400 | 413 | 422 => Answer::Refused(why),
        _ => Answer::Away(why),
    }
}

/// Makes the database; whether that worked shows at the next batch.
fn create(agent: &Agent, target: &Target) {
    if let Some(address) = &target.create {
        let mut request = agent.post(address);
        if let Some(authorization) = &target.authorization {
            request = request.header("Authorization", authorization);
        }
        let _ = request.send_empty();
    }
}
