//! Mutations of inputs: the same ones for the same seed, without other tools. `libFuzzer` also follows the branches of
//! the code.

use std::fs;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use hums::rng::Rng;

use crate::Target;

const NUMBERS: [u64; 12] = [0, 1, 2, 7, 0x7f, 0x80, 0xff, 0x7fff, 0x8000, 0xffff, 0x7fff_ffff, u64::MAX];

/// Makes inputs from those of a corpus.
#[derive(Debug)]
pub struct Mutator {
    rng: Rng,
    corpus: Vec<Vec<u8>>,
    bytes_max: usize,
}

impl Mutator {
    /// From these inputs; no input is longer than `bytes_max`.
    pub fn new(seed: u64, corpus: Vec<Vec<u8>>, bytes_max: usize) -> Self {
        Self { rng: Rng::new(seed, 0x6675_7a7a), corpus, bytes_max }
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.rng.next_u64() % limit.max(1) as u64) as usize
    }

    fn noise(&mut self, length: usize) -> Vec<u8> {
        (0..length).map(|_| self.rng.next_u64() as u8).collect()
    }

    fn pick(&mut self) -> Vec<u8> {
        let index = self.below(self.corpus.len());
        self.corpus.get(index).cloned().unwrap_or_default()
    }

    /// The next input: one of the corpus with one to eight changes, or noise.
    pub fn input(&mut self) -> Vec<u8> {
        let mut bytes = self.pick();
        if bytes.is_empty() || self.below(50) == 0 {
            let length = self.below(self.bytes_max);
            bytes = self.noise(length);
        }
        for _ in 0..=self.below(8) {
            self.change(&mut bytes);
        }
        bytes.truncate(self.bytes_max);
        bytes
    }

    fn change(&mut self, bytes: &mut Vec<u8>) {
        let at = self.below(bytes.len());
        let length = 1 << self.below(8);
        let end = (at + self.below(length) + 1).min(bytes.len());
        let part = at.min(end)..end;
        match self.below(9) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(part)),
            2 => {
                let doubled = bytes.get(part).unwrap_or_default().to_vec();
                let times = 1 + self.below(8);
                bytes.splice(at..at, doubled.repeat(times));
            }
            3 => bytes.get_mut(part).unwrap_or_default().fill([0, 0xff][self.below(2)]),
            4 => {
                let noise = self.noise(end - at.min(end));
                bytes.splice(part, noise);
            }
            5 => {
                let number = NUMBERS[self.below(NUMBERS.len())];
                let width = [1, 2, 4, 8][self.below(4)];
                let big = self.below(2) == 0;
                let number = if big {
                    number.to_be_bytes()[8 - width..].to_vec()
                } else {
                    number.to_le_bytes()[..width].to_vec()
                };
                for (to, from) in bytes.iter_mut().skip(at).zip(number) {
                    *to = from;
                }
            }
            6 => {
                let other = self.pick();
                let from = self.below(other.len());
                bytes.truncate(at);
                bytes.extend_from_slice(other.get(from..).unwrap_or_default());
            }
            _ => {
                let bit = self.below(8);
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= 1 << bit;
                }
            }
        }
    }
}

/// An input that broke a rule.
#[derive(Debug)]
pub struct Broken {
    /// The target.
    pub target: &'static str,
    /// The input's path.
    pub path: PathBuf,
}

/// The inputs of a target's corpus, in the order of their names.
pub fn corpus(target: &Target) -> io::Result<Vec<Vec<u8>>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target.name);
    let mut paths = match fs::read_dir(&folder) {
        Ok(entries) => entries.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>()?,
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        Err(error) => return Err(error),
    };
    paths.sort();
    paths.iter().map(fs::read).collect()
}

/// Runs the target on its corpus, then on mutations while `go_on` agrees, which gets their number so far. Returns the
/// number of inputs, or the first that broke it.
pub fn run(
    target: &'static Target,
    seed: u64,
    mut go_on: impl FnMut(u64) -> bool,
) -> io::Result<Result<u64, Broken>> {
    let corpus = corpus(target)?;
    let mut tried = 0;
    for input in &corpus {
        if !holds(target, input) {
            return Ok(Err(keep(target, input)?));
        }
        tried += 1;
    }
    let mut mutator = Mutator::new(seed, corpus, target.bytes_max);
    let mut mutations = 0;
    while go_on(mutations) {
        let input = mutator.input();
        if !holds(target, &input) {
            return Ok(Err(keep(target, &input)?));
        }
        mutations += 1;
    }
    Ok(Ok(tried + mutations))
}

fn holds(target: &Target, input: &[u8]) -> bool {
    catch_unwind(AssertUnwindSafe(|| (target.check)(input))).is_ok()
}

fn keep(target: &'static Target, input: &[u8]) -> io::Result<Broken> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/fuzz");
    fs::create_dir_all(&folder)?;
    // FNV-1a: a name for the same bytes.
    let hash = input.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let path = folder.join(format!("{}-{hash:016x}", target.name));
    fs::write(&path, input)?;
    Ok(Broken { target: target.name, path })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_gives_the_same_inputs_and_none_is_too_long() {
        let inputs = |seed| {
            let mut mutator = Mutator::new(seed, vec![b"some input".to_vec(), vec![0; 100]], 64);
            (0..500).map(|_| mutator.input()).collect::<Vec<_>>()
        };
        assert_eq!(inputs(1), inputs(1));
        assert_ne!(inputs(1), inputs(2));
        assert!(inputs(3).iter().all(|input| input.len() <= 64));
    }

    #[test]
    fn an_input_that_breaks_a_target_is_kept() {
        static TARGET: Target = Target {
            name: "test-of-mutate",
            bytes_max: 100,
            rounds: 0,
            check: |data| assert!(data.len() < 50, "for this test"),
        };
        let broken = run(&TARGET, 1, |mutations| mutations < 1_000).expect("files").expect_err("broken");
        assert!(fs::read(&broken.path).expect("the input").len() >= 50);
        fs::remove_file(&broken.path).expect("it was there");
    }
}
