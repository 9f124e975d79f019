//! Each fuzz target on its corpus and on a short round of mutations, the same ones each time.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::collections::BTreeSet;
use std::path::Path;
use std::thread;

use hums_fuzz::{TARGETS, mutate};

#[test]
fn nothing_breaks_a_target_neither_its_corpus_nor_mutations_of_it() {
    thread::scope(|scope| {
        let runs: Vec<_> = TARGETS
            .iter()
            .map(|target| {
                let start = std::time::Instant::now();
                let run = move || mutate::run(target, 1, |mutations| mutations < target.rounds).unwrap();
                (target, start, scope.spawn(run))
            })
            .collect();
        for (target, start, run) in runs {
            match run.join().unwrap() {
                Ok(tried) => {
                    println!("{:<12} {tried} inputs, {:.1} s", target.name, start.elapsed().as_secs_f64());
                }
                Err(broken) => panic!("{}: {} breaks it", broken.target, broken.path.display()),
            }
        }
    });
}

#[test]
fn each_target_has_a_corpus_and_each_folder_of_it_a_target() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    let folders: BTreeSet<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    let targets: BTreeSet<String> = TARGETS.iter().map(|target| target.name.to_owned()).collect();
    assert_eq!(folders, targets);
    for target in TARGETS {
        let corpus = mutate::corpus(target).unwrap();
        let bytes: usize = corpus.iter().map(Vec::len).sum();
        assert!(!corpus.is_empty() && bytes < 64 * 1024, "{}: {bytes} bytes", target.name);
    }
}
