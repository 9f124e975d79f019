//! `hums live` as a server and as a service.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use hums_tests::flights::own;
use hums_tests::live::{Live, Page, Running, ask_for_events, free_port};
use hums_tests::program::{self, command};
use rustix::net::sockopt::set_socket_linger;

fn open_page(live: &Live) -> Page {
    let end = Instant::now() + Duration::from_secs(5);
    loop {
        match live.page() {
            Ok(page) => return page,
            Err(answer) => assert!(Instant::now() < end, "no page opens any longer: {answer}"),
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn two_hundred_broken_off_connections_take_no_pages_place() {
    let recording = own("px4_hil_quad_low.tlog");
    let live = Live::start(&[recording.to_str().unwrap()]);
    for number in 0..200_u64 {
        let stream = ask_for_events(live.host());
        // Like a tablet on a bad radio: reset at once or a moment later.
        set_socket_linger(&stream, Some(Duration::ZERO)).unwrap();
        std::thread::sleep(Duration::from_micros(number % 5 * 250));
    }
    open_page(&live);
}

/// On a link without a frame, where pages get little.
#[test]
fn a_page_too_many_is_refused_and_a_later_one_gets_the_place_of_one_that_went() {
    let live = Live::start(&[&format!("udpin:127.0.0.1:{}", free_port())]);
    let mut pages: Vec<Page> = (0..16).map(|_| open_page(&live)).collect();
    assert_eq!(live.page().err().as_deref(), Some("HTTP/1.1 503 Service Unavailable"));
    pages.pop();
    pages.push(open_page(&live));
    for page in &mut pages {
        let message = page.message();
        assert!(message.starts_with("{\"t\":\"head\""), "{message}");
    }
}

#[test]
fn a_request_that_does_not_come_is_ended_and_keeps_no_page_waiting() {
    let live = Live::start(&[&format!("udpin:127.0.0.1:{}", free_port())]);
    let mut slow = TcpStream::connect(live.host()).unwrap();
    slow.write_all(b"GET / HT").unwrap();
    open_page(&live);
    slow.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let mut answer = String::new();
    slow.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 408 "), "{answer}");
}

/// The connection ends, and later ones get no answer.
#[test]
fn a_link_that_is_gone_keeps_neither_the_page_nor_the_end_waiting() {
    let vehicle = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = vehicle.local_addr().unwrap();
    let mut live = Live::start(&[&format!("tcp:{address}")]);
    // With a full queue of one, the system drops further first packets.
    rustix::net::listen(&vehicle, 0).unwrap();
    drop(vehicle.accept().unwrap());
    let fill = || TcpStream::connect_timeout(&address, Duration::from_millis(300));
    let queued: Vec<_> = (0..16).map_while(|_| fill().ok()).collect();
    assert!(queued.len() < 16, "connections are still taken");
    std::thread::sleep(Duration::from_millis(1_500));
    open_page(&live);
    live.program.signal("INT");
    assert_eq!(live.program.end(Duration::from_secs(2)), Some(0));
}

#[test]
fn a_phone_is_given_an_address_and_the_token() {
    let mut live = command(["live", "--listen", "0.0.0.0:0"]);
    live.arg(own("px4_hil_quad_low.tlog")).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut child = live.spawn().unwrap();
    let stdout = child.stdout.take().unwrap();
    let mut live = Running(child);
    let mut lines = BufReader::new(stdout).lines().map_while(Result::ok);
    let here = lines.next().unwrap();
    let (_, token) = here.split_once("/#token=").expect("the token is in the address");
    let port: u16 = here.trim_start_matches("http://localhost:").split('/').next().unwrap().parse().unwrap();
    live.signal("TERM");
    assert_eq!(live.end(Duration::from_secs(20)), Some(0), "SIGTERM is Ctrl-C");
    // A PC without a network has none.
    for line in lines {
        let (address, rest) = line.trim_start_matches("http://").split_once('/').unwrap();
        let address: std::net::SocketAddr = address.parse().unwrap();
        assert!(!address.ip().is_loopback() && !address.ip().is_unspecified(), "{line}");
        assert_eq!((address.port(), rest), (port, format!("#token={token}").as_str()));
    }
}

fn wait_for(image: &Path) {
    let start = Instant::now();
    while !image.exists() {
        assert!(start.elapsed() < Duration::from_secs(20), "it does not begin");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn sigterm_ends_a_recording_as_ctrl_c_does_with_the_log_closed() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    let port = free_port();
    let mut sim = command(["sim", "--json", &format!("udpin:127.0.0.1:{port}"), "--sd"]);
    let child = sim.arg(&image).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let mut sim = Running(child);
    wait_for(&image);
    std::thread::sleep(Duration::from_secs(1));
    sim.signal("TERM");
    assert_eq!(sim.end(Duration::from_secs(20)), Some(0));
    let json = program::hums_with("info --verify --json {}", &[&image]).text();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["logs"][0]["closed"], true, "{json}");
}

#[test]
fn a_recording_that_is_broken_off_is_not_called_whole() {
    let dir = tempfile::tempdir().unwrap();
    let (image, said) = (dir.path().join("card.img"), dir.path().join("said"));
    let mut sim = command(["sim", "--speed", "real"]);
    sim.arg(own("px4_hil_quad_low.tlog")).arg("--sd").arg(&image);
    let child = sim.stdout(Stdio::null()).stderr(std::fs::File::create(&said).unwrap()).spawn().unwrap();
    let mut sim = Running(child);
    wait_for(&image);
    std::thread::sleep(Duration::from_millis(300));
    sim.signal("TERM");
    assert_eq!(sim.end(Duration::from_secs(20)), Some(3));
    let said = std::fs::read_to_string(said).unwrap();
    assert!(said.contains("was not read to its end"), "{said}");
}

#[test]
fn a_server_that_takes_no_point_refuses_none() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", server.local_addr().unwrap());
    std::thread::spawn(move || {
        for stream in server.incoming().flatten() {
            let mut reader = BufReader::new(stream);
            let headers = (&mut reader).lines().map_while(Result::ok).take_while(|line| !line.is_empty());
            let length = headers
                .filter_map(|line| line.to_lowercase().strip_prefix("content-length:")?.trim().parse().ok())
                .last();
            reader.read_exact(&mut vec![0; length.unwrap_or(0)]).unwrap();
            let body = "{\"error\":\"no handler found\"}";
            let head = format!("HTTP/1.1 400 Bad Request\r\nContent-Length: {}\r\n", body.len());
            let answer = head + "Connection: close\r\n\r\n" + body;
            reader.get_mut().write_all(answer.as_bytes()).unwrap();
        }
    });
    let recording = own("px4_hil_quad_low.tlog");
    let live = Live::start(&[recording.to_str().unwrap(), "--influx", &url]);
    live.program.signal("TERM");
    std::thread::sleep(Duration::from_millis(500));
    let (code, words) = live.terminate(Duration::from_secs(10));
    assert_eq!(code, Some(3), "{words}");
    assert!(words.contains(" lost while the database took none") && !words.contains("refused by"), "{words}");
    assert!(words.contains("has taken no point so far"), "{words}");
}

#[test]
fn sigterm_and_ctrl_c_alike_say_what_is_not_in_the_database_and_a_second_one_ends_the_wait() {
    // A port without a listener.
    let url = format!("http://127.0.0.1:{}", free_port());
    let recording = own("px4_hil_quad_low.tlog");
    let input = [recording.to_str().unwrap(), "--influx", &url];
    let live = Live::start(&input);
    live.program.signal("TERM");
    std::thread::sleep(Duration::from_millis(500));
    let (code, words) = live.terminate(Duration::from_secs(5));
    assert_eq!(code, Some(3), "the second one: {words}");
    assert!(words.contains("not in the database"), "{words}");

    let live = Live::start(&input);
    let (code, words) = live.terminate(Duration::from_secs(40));
    assert_eq!(code, Some(3), "{words}");
    // One or some, by the time of the end.
    assert!(words.contains("not in the database"), "{words}");
}

#[test]
fn sigterm_ends_what_waits_for_a_board() {
    let link = format!("udpin:127.0.0.1:{}", free_port());
    let mut pull = Command::new(program::path());
    let dir = tempfile::tempdir().unwrap();
    pull.args(["box", "pull", "--link", &link, "-o"]).arg(dir.path()).stderr(Stdio::piped());
    let mut child = pull.spawn().unwrap();
    let mut stderr = child.stderr.take().unwrap();
    let mut pull = Running(child);
    std::thread::sleep(Duration::from_millis(500));
    pull.signal("TERM");
    assert_eq!(pull.end(Duration::from_secs(5)), Some(1));
    let mut words = String::new();
    stderr.read_to_string(&mut words).unwrap();
    assert!(words.contains("interrupted"), "{words}");
}

#[test]
fn two_signals_at_once_are_one_wish_and_end_nothing_without_a_word() {
    let url = format!("http://127.0.0.1:{}", free_port());
    let recording = own("px4_hil_quad_low.tlog");
    let live = Live::start(&[recording.to_str().unwrap(), "--influx", &url]);
    // Like `timeout -s INT`: program and group.
    let interrupt = || live.program.signal("INT");
    interrupt();
    interrupt();
    std::thread::sleep(Duration::from_millis(300));
    // Ends the wait for the database.
    let (code, words) = live.interrupt(Duration::from_secs(5));
    assert_eq!(code, Some(3), "{words}");
    assert!(words.contains("not in the database"), "{words}");
}
