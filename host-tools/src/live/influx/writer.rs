//! Writes each batch until the database has it, or refuses it.
//!
//! A refused batch is tried again in halves: a bad point costs only itself. A point written twice is the same point. `InfluxDB`
//! 1.x and 2 write the good points, and answer 400 or 422 with the number of dropped ones: no second try.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::{Context as _, Result};
use ureq::Agent;

use super::batch::Batch;
use super::queue::{Delivery, Queue};
use super::target::Target;

const LIMIT: Duration = Duration::from_secs(10);
/// Wait after a failure; doubles up to the longest.
const WAIT_MIN: Duration = Duration::from_millis(200);
const WAIT_MAX: Duration = Duration::from_secs(5);
const ANSWER_BYTES_MAX: u64 = 64 * 1024;
/// Maximum number of characters reported from it.
const WORDS_MAX: usize = 200;
/// For one batch: a bad point among 2,048 takes at most 30; beyond this good points are lost with bad ones.
const REQUESTS_MAX: usize = 64;

#[derive(Debug)]
enum Answer {
    Taken,
    /// Invalid: no other try; with the number of unwritten points if the rest was written.
    Refused(String, Option<u64>),
    Missing(String),
    /// Busy, or wants another token.
    Away(String),
}

/// Ends with a closed, empty queue, or its time.
pub fn start(target: Target, queue: Arc<Queue>) -> Result<JoinHandle<()>> {
    // An error: the server behind it gets no points, and may confirm them.
    let config = Agent::config_builder()
        .timeout_global(Some(LIMIT))
        .http_status_as_error(false)
        .max_redirects(0)
        .max_redirects_will_error(false);
    let agent: Agent = config.build().into();
    let thread = std::thread::Builder::new().name("influx".to_owned());
    thread
        .spawn(move || write_all(&agent, &target, &queue))
        .context("--influx: no thread; close other programs")
}

fn write_all(agent: &Agent, target: &Target, queue: &Queue) {
    // A server that refuses all may be the wrong one.
    let mut has_taken = false;
    while let Some(batch) = queue.take() {
        let mut wait = WAIT_MIN;
        loop {
            let deliver = |lines: &[u8]| persist(agent, target, queue, lines);
            // Counted as waiting.
            let Some(delivered) = in_halves(&batch, deliver) else { return };
            has_taken |= delivered.written > 0;
            if has_taken {
                queue.done(delivered);
                break;
            }
            if !queue.trouble(format!("it has taken no point so far: {}", delivered.why), wait) {
                return;
            }
            wait = (wait * 2).min(WAIT_MAX);
        }
    }
}

/// Writes until the database takes them; `None` when the time at the end is over.
fn persist(agent: &Agent, target: &Target, queue: &Queue, lines: &[u8]) -> Option<Answer> {
    let mut wait = WAIT_MIN;
    loop {
        let why = match write(agent, target, lines) {
            answer @ (Answer::Taken | Answer::Refused(..)) => return Some(answer),
            Answer::Missing(why) => {
                create(agent, target);
                why
            }
            Answer::Away(why) => why,
        };
        if !queue.trouble(why, wait) {
            return None;
        }
        wait = (wait * 2).min(WAIT_MAX);
    }
}

/// Refused parts in halves, with bounded requests.
fn in_halves(batch: &Batch, mut deliver: impl FnMut(&[u8]) -> Option<Answer>) -> Option<Delivery> {
    let mut delivered = Delivery::default();
    // The first one last.
    let mut parts: Vec<(&[u8], u64)> = vec![(&batch.text, batch.points)];
    let mut requests = 0;
    while let Some((lines, points)) = parts.pop() {
        requests += 1;
        let Answer::Refused(why, dropped) = deliver(lines)? else {
            delivered.written += points;
            continue;
        };
        delivered.why = why;
        if let Some(dropped) = dropped {
            delivered.refused += dropped.min(points);
            delivered.written += points.saturating_sub(dropped);
            continue;
        }
        match halves(lines).filter(|_| requests + parts.len() + 2 <= REQUESTS_MAX) {
            Some((first, second)) => {
                let of_first = points_of(first);
                parts.push((second, points.saturating_sub(of_first)));
                parts.push((first, of_first));
            }
            None => delivered.refused += points,
        }
    }
    Some(delivered)
}

/// `None` for a single line.
fn halves(lines: &[u8]) -> Option<(&[u8], &[u8])> {
    let end = |from: usize| lines.get(from..)?.iter().position(|byte| *byte == b'\n').map(|at| from + at + 1);
    let start = lines.get(..lines.len() / 2)?.iter().rposition(|byte| *byte == b'\n').map(|at| at + 1);
    let cut = end(lines.len() / 2).filter(|cut| *cut < lines.len()).or(start)?;
    Some(lines.split_at(cut))
}

fn points_of(lines: &[u8]) -> u64 {
    lines.split_inclusive(|byte| *byte == b'\n').count() as u64
}

fn write(agent: &Agent, target: &Target, lines: &[u8]) -> Answer {
    let mut request = agent.post(&target.write).content_type("text/plain; charset=utf-8");
    if let Some(authorization) = &target.authorization {
        request = request.header("Authorization", authorization);
    }
    let mut response = match request.send(lines) {
        Ok(response) => response,
        Err(error) => return Answer::Away(error.to_string()),
    };
    let status = response.status().as_u16();
    let body = response.body_mut().with_config().limit(ANSWER_BYTES_MAX).read_to_string();
    answer(status, &body.unwrap_or_default())
}

/// A database answers exactly 204 for all points, and explains refused ones with a JSON object. Another text is another
/// server's, or of one that wants https.
fn answer(status: u16, body: &str) -> Answer {
    let words: String = body.chars().take(WORDS_MAX).collect();
    let words = words.trim();
    let why = format!("the database answers {status}: {words}");
    match status {
        204 => Answer::Taken,
        404 => Answer::Missing(why),
        201 | 400 | 413 | 422 if is_refusal(body) => Answer::Refused(why, dropped(body)),
        200..300 | 400 | 413 | 422 => Answer::Away(format!(
            "a server answers {status}, not as a database does: is the address right, and does it want https (which needs a \
             proxy on this PC)? {words}"
        )),
        _ => Answer::Away(why),
    }
}

/// About points: `InfluxDB` 1.x and 3 and Telegraf's listener have an `error`, `InfluxDB` 2, `QuestDB` and Telegraf's listener
/// of version 2 a `code` and a `message`. (`VictoriaMetrics` passes over bad lines.)
fn is_refusal(body: &str) -> bool {
    let Ok(serde_json::Value::Object(answer)) = serde_json::from_str(body) else { return false };
    let has = |name| answer.get(name).is_some_and(serde_json::Value::is_string);
    has("error") || has("code") && has("message")
}

/// "partial write: ... dropped=3". 0 for unreadable lines (`InfluxDB` 1.x).
fn dropped(body: &str) -> Option<u64> {
    let (_, partial) = body.split_once("partial write")?;
    let (_, after) = partial.rsplit_once("dropped=")?;
    let digits = after.split(|c: char| !c.is_ascii_digit()).next()?;
    digits.parse().ok().filter(|dropped| *dropped > 0)
}

/// Its success shows at the next batch.
fn create(agent: &Agent, target: &Target) {
    if let Some(address) = &target.create {
        let mut request = agent.post(address);
        if let Some(authorization) = &target.authorization {
            request = request.header("Authorization", authorization);
        }
        let _ = request.send_empty();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNREADABLE: &str = "{\"code\":\"invalid\",\"message\":\"unable to parse 'BAD': missing fields\"}";

    #[test]
    fn what_no_database_says_leaves_the_points_waiting() {
        for (status, body) in [
            // Go's, and so of InfluxDB, VictoriaMetrics and Caddy; nginx's; any web server's.
            (400, "Client sent an HTTP request to an HTTPS server.\n"),
            (
                400,
                "<html><head><title>400 The plain HTTP request was sent to HTTPS port</title></head></html>",
            ),
            (200, "<html>Welcome to your router</html>"),
            (200, "{\"results\":[]}"),
            (202, ""),
            (413, "<html>413 Request Entity Too Large</html>"),
            (400, "{\"message\":\"Bad Request\"}"),
        ] {
            let Answer::Away(why) = answer(status, body) else { panic!("{status} {body}") };
            assert!(why.contains("https") && why.contains(&status.to_string()), "{why}");
        }
        assert!(matches!(answer(401, "{\"code\":\"unauthorized\",\"message\":\"\"}"), Answer::Away(_)));
        assert!(matches!(answer(204, ""), Answer::Taken));
        for body in [
            // InfluxDB 1.x, 2 and 3, Telegraf's two listeners, QuestDB.
            "{\"error\":\"unable to parse 'x': missing fields\"}\n",
            UNREADABLE,
            "{\"error\":\"partial write of line protocol occurred\",\"data\":[{\"error_message\":\"x\",\"line_number\":1}]}",
            "{\"error\":\"http: bad request\"}",
            "{\"code\":\"internal error\",\"message\":\"x\",\"op\":\"\",\"err\":\"x\",\"line\":\"0\"}",
            "{\"code\":\"invalid\",\"message\":\"failed to parse line protocol\",\"line\":2,\"errorId\":\"x-0\"}",
        ] {
            assert!(matches!(answer(400, body), Answer::Refused(_, None)), "{body}");
        }
    }

    fn batch(lines: u64, bad: &[u64]) -> Batch {
        let line =
            |number| if bad.contains(&number) { "BAD\n".to_owned() } else { format!("m v={number}\n") };
        Batch { text: (0..lines).map(line).collect::<String>().into_bytes(), points: lines }
    }

    /// Refuses any request with a bad line. Returns result, stored lines and requests.
    fn deliver(batch: &Batch) -> (Delivery, Vec<String>, usize) {
        let (mut has, mut requests) = (Vec::new(), 0);
        let delivered = in_halves(batch, |lines| {
            requests += 1;
            let text = std::str::from_utf8(lines).expect("text");
            assert!(text.ends_with('\n'), "whole lines");
            if text.contains("BAD") {
                return Some(answer(400, UNREADABLE));
            }
            has.extend(text.lines().map(str::to_owned));
            Some(Answer::Taken)
        });
        (delivered.expect("it answers"), has, requests)
    }

    #[test]
    fn a_bad_point_costs_itself_wherever_it_stands() {
        for bad in [0, 1, 1_023, 1_024, 2_046, 2_047] {
            let (delivered, has, requests) = deliver(&batch(2_048, &[bad]));
            assert_eq!((delivered.written, delivered.refused), (2_047, 1), "{bad}");
            assert!(delivered.why.contains("unable to parse"));
            assert_eq!(has.len(), 2_047);
            assert!(requests <= 30, "{requests} requests");
        }
        let (delivered, _, requests) = deliver(&batch(1, &[0]));
        assert_eq!((delivered.written, delivered.refused, requests), (0, 1, 1));
        assert_eq!(deliver(&batch(2_048, &[])).0, Delivery { written: 2_048, ..Delivery::default() });
    }

    #[test]
    fn a_batch_of_bad_points_takes_a_bounded_number_of_requests_and_each_point_is_counted() {
        for step in [1, 2, 7, 100] {
            let bad: Vec<u64> = (0..2_048).step_by(step).collect();
            let (delivered, has, requests) = deliver(&batch(2_048, &bad));
            assert!(requests <= REQUESTS_MAX, "{requests}");
            assert_eq!(delivered.written, has.len() as u64);
            assert_eq!(delivered.written + delivered.refused, 2_048);
        }
    }

    #[test]
    fn what_the_database_wrote_of_a_refused_batch_is_not_counted_as_refused() {
        let partial = "{\"error\":\"partial write: field type conflict: input field \\\"v\\\" dropped=3\"}";
        for (status, body, expected) in [
            (400, partial, Some(3)),
            (
                422,
                "{\"code\":\"unprocessable entity\",\"message\":\"failure writing points to database: partial write: ... dropped=12\"}",
                Some(12),
            ),
            (400, "{\"error\":\"partial write: unable to parse 'x': missing fields dropped=0\"}", None),
            (400, "{\"error\":\"unable to parse 'x': dropped=3\"}", None),
        ] {
            let Answer::Refused(_, dropped) = answer(status, body) else { panic!("{status} refuses") };
            assert_eq!(dropped, expected, "{body}");
        }
        let mut requests = 0;
        let delivered = in_halves(&batch(100, &[]), |_| {
            requests += 1;
            Some(answer(400, partial))
        });
        let delivered = delivered.expect("it answers");
        assert_eq!((delivered.written, delivered.refused, requests), (97, 3, 1));
    }

    #[test]
    fn a_database_that_goes_away_between_the_halves_leaves_the_whole_batch_waiting() {
        let mut requests = 0;
        let delivered = in_halves(&batch(100, &[7]), |_| {
            requests += 1;
            (requests < 3).then(|| answer(400, UNREADABLE))
        });
        assert_eq!(delivered, None);
    }
}
