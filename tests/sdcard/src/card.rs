//! A card with power: its answer to each byte.

use std::collections::VecDeque;

use crate::MS;
use crate::fault::Fault;
use crate::model::{Kind, Model, crc7, crc16};

/// Clocks with an unselected card that it needs before its first command (6.4.1).
const WAKE_CLOCKS: u32 = 74;
const IDENTIFICATION_HZ: u32 = 400_000;
const TRANSFER_HZ: u32 = 25_000_000;

/// Bits of an answer (7.3.2.1).
const IDLE: u8 = 1;
const ILLEGAL: u8 = 4;
const DAMAGED: u8 = 8;
const ADDRESS: u8 = 0x20;
const PARAMETER: u8 = 0x40;
/// Bits of a status (7.3.2.3).
const STATUS_ERROR: u8 = 4;
const STATUS_LOCKED: u8 = 0x20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Native,
    Idle,
    Ready,
}

#[derive(Debug, PartialEq, Eq)]
enum Transfer {
    None,
    /// Waits for a token, or takes a block.
    Write {
        many: bool,
        at: u32,
        block: Option<Vec<u8>>,
        failed: bool,
    },
    /// The next block.
    Read {
        next: u32,
    },
}

// Each is a flag of the specification.
#[allow(clippy::struct_excessive_bools)]
pub(crate) struct SdCard {
    pub(crate) model: Model,
    state: State,
    clocks: u32,
    started_ns: Option<u64>,
    knows_conditions: bool,
    app: bool,
    erases: u32,
    checks: bool,
    status: u8,
    command: Vec<u8>,
    out: VecDeque<u8>,
    /// Ready from this time on.
    pending: Option<(u64, Vec<u8>)>,
    busy_until_ns: u64,
    was_busy: bool,
    transfer: Transfer,
    /// Its content before.
    programmed: Option<(u32, [u8; 512])>,
    noise: u32,
    begun: Option<u8>,
}

impl SdCard {
    pub(crate) fn new(model: Model) -> Self {
        Self {
            model,
            state: State::Native,
            clocks: 0,
            started_ns: None,
            knows_conditions: false,
            app: false,
            erases: 0,
            checks: false,
            status: 0,
            command: Vec::new(),
            out: VecDeque::new(),
            pending: None,
            busy_until_ns: 0,
            was_busy: false,
            transfer: Transfer::None,
            programmed: None,
            noise: 1,
            begun: None,
        }
    }

    /// Violations go to `wrong`.
    pub(crate) fn exchange(
        &mut self,
        now_ns: u64,
        hz: u32,
        selected: bool,
        sent: u8,
        wrong: &mut impl FnMut(String),
    ) -> u8 {
        let hz_max = if self.state == State::Ready { TRANSFER_HZ } else { IDENTIFICATION_HZ };
        if hz > hz_max {
            wrong(format!("{hz} Hz in state {:?}", self.state));
        }
        if !selected {
            self.clocks = self.clocks.saturating_add(8);
            return 0xFF;
        }
        let answer = self.begun.take().unwrap_or_else(|| self.answer(now_ns));
        self.take(now_ns, sent, wrong);
        if self.model.has(now_ns, |fault| fault == Fault::Noise).is_some() {
            self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            return (self.noise >> 24) as u8;
        }
        answer
    }

    pub(crate) fn begin(&mut self, now_ns: u64) -> u8 {
        let answer = self.answer(now_ns);
        *self.begun.insert(answer)
    }

    pub(crate) fn deselected(&mut self, wrong: &mut impl FnMut(String)) {
        self.begun = None;
        if !self.command.is_empty() {
            wrong(format!("deselected within command {}", self.command[0] & 0x3F));
        }
        if !self.out.is_empty() {
            wrong("deselected before the answer's end".to_owned());
        }
        if matches!(self.transfer, Transfer::Write { block: Some(_), .. }) {
            wrong("deselected within a block".to_owned());
        }
    }

    /// Of a block in programming only the first half is new.
    pub(crate) fn power_off(&self, now_ns: u64) {
        if let Some((at, before)) = self.programmed.filter(|_| self.is_busy(now_ns)) {
            self.model.medium.patch(at, 256, &before[256..]);
        }
    }

    fn answer(&mut self, now_ns: u64) -> u8 {
        if let Some(byte) = self.out.pop_front() {
            return byte;
        }
        if self.is_busy(now_ns) {
            self.was_busy = true;
            return 0;
        }
        // It becomes ready in the middle of a byte.
        if std::mem::take(&mut self.was_busy) {
            return 0x1F;
        }
        if let Some((_, block)) = self.pending.take_if(|(at, _)| *at <= now_ns) {
            self.out.extend(block);
            if let Transfer::Read { next: at } = self.transfer {
                self.transfer = Transfer::Read { next: at + 1 };
                // Behind the last block.
                let is_there = at < self.model.medium.size();
                let bytes = if is_there {
                    let data = self.model.medium.get(at);
                    self.block(now_ns, &data)
                } else {
                    vec![0x08]
                };
                self.pending = Some((now_ns + self.model.read_next_ns, bytes));
            }
            return self.out.pop_front().unwrap_or(0xFF);
        }
        0xFF
    }

    fn is_busy(&self, now_ns: u64) -> bool {
        now_ns < self.busy_until_ns
    }

    fn take(&mut self, now_ns: u64, sent: u8, wrong: &mut impl FnMut(String)) {
        if let Transfer::Write { many, block, .. } = &mut self.transfer {
            if let Some(taken) = block {
                taken.push(sent);
                if taken.len() == 514 {
                    self.write_block(now_ns);
                }
                return;
            }
            let token = if *many { 0xFC } else { 0xFE };
            if self.command.is_empty() && (sent == token || *many && sent == 0xFD) {
                if now_ns < self.busy_until_ns {
                    wrong(format!("token {sent:#04x} while busy"));
                } else if sent == token {
                    *block = Some(Vec::new());
                } else {
                    self.transfer = Transfer::None;
                    self.busy_until_ns = now_ns + self.model.write_ns.0;
                    // Before the busy signal (7.2.4).
                    self.out.push_back(0xFF);
                }
                return;
            }
        }
        if self.command.is_empty() && sent & 0xC0 != 0x40 {
            return;
        }
        self.command.push(sent);
        if self.command.len() == 6 {
            let command: [u8; 6] = std::mem::take(&mut self.command).try_into().unwrap_or_default();
            if self.is_busy(now_ns) {
                // One that stays busy for ever ignores commands; others may be reset, which should not be done.
                if self.busy_until_ns == u64::MAX {
                    return;
                }
                wrong(format!("command {} while busy", command[0] & 0x3F));
                if command[0] & 0x3F != 0 {
                    return;
                }
            }
            self.command(now_ns, &command, wrong);
        }
    }

    fn command(&mut self, now_ns: u64, frame: &[u8; 6], wrong: &mut impl FnMut(String)) {
        let (number, argument) =
            (frame[0] & 0x3F, u32::from_be_bytes([frame[1], frame[2], frame[3], frame[4]]));
        let is_whole = crc7(&frame[..5]) == frame[5];
        if self.state == State::Native {
            if self.clocks < WAKE_CLOCKS {
                wrong(format!("command {number} after {} clocks", self.clocks));
            } else if number == 0 && is_whole {
                self.state = State::Idle;
                self.answer_with(IDLE, &[]);
            }
            return;
        }
        if self.model.has(now_ns, |fault| fault == Fault::Silent).is_some() {
            return;
        }
        let is_damaged = self.model.has(now_ns, |fault| fault == Fault::DamagedCommand).is_some();
        if (self.checks || number == 0 || number == 8) && (!is_whole || is_damaged) {
            return self.answer_with(DAMAGED, &[]);
        }
        let is_app = std::mem::take(&mut self.app);
        let is_idle = self.state == State::Idle;
        let in_row = matches!(self.transfer, Transfer::Write { .. });
        let reads = matches!(self.transfer, Transfer::Read { .. });
        match (is_app, number) {
            (_, 0) => self.reset(),
            (_, 12) if in_row => {
                self.transfer = Transfer::None;
                self.out.push_back(0xFF);
                self.answer_with(0, &[]);
                self.busy_until_ns = now_ns + self.model.write_ns.0;
            }
            (_, 12) if reads => {
                self.transfer = Transfer::None;
                self.out.clear();
                self.pending = None;
                self.out.push_back(0xFF);
                self.answer_with(0, &[]);
            }
            (_, 13) if !is_idle && !reads => {
                let status = std::mem::take(&mut self.status);
                self.answer_with(0, &[status]);
            }
            _ if in_row || reads => self.answer_with(ILLEGAL, &[]),
            (_, 8) if self.model.kind != Kind::Old => {
                self.knows_conditions = true;
                self.answer_with(0, &[0, 0, (argument >> 8) as u8 & 0x0F, argument as u8]);
            }
            (_, 55) => {
                self.app = true;
                self.answer_with(0, &[]);
            }
            (_, 59) => {
                self.checks = argument & 1 == 1;
                self.answer_with(0, &[]);
            }
            (_, 58) => {
                let ready = u8::from(!is_idle) << 7;
                let high = u8::from(!is_idle && !self.model.kind.by_bytes()) << 6;
                self.answer_with(0, &[ready | high, 0xFF, 0x80, 0]);
            }
            (true, 41) => self.start(now_ns, argument),
            (true, 23) if !is_idle => {
                self.erases = argument & 0x7F_FFFF;
                self.answer_with(0, &[]);
            }
            (false, _) if !is_idle => self.data_command(now_ns, number, argument),
            _ => self.answer_with(ILLEGAL, &[]),
        }
    }

    fn reset(&mut self) {
        let model = self.model.clone();
        *self = Self { state: State::Idle, clocks: WAKE_CLOCKS, noise: self.noise, ..Self::new(model) };
        self.answer_with(0, &[]);
    }

    fn start(&mut self, now_ns: u64, argument: u32) {
        let since = *self.started_ns.get_or_insert(now_ns);
        // A large card does not start for a host without support of large cards (4.2.3).
        let is_known = self.model.kind.by_bytes() || argument >> 30 & 1 == 1 && self.knows_conditions;
        if is_known && now_ns - since >= self.model.start_ns {
            self.state = State::Ready;
        }
        self.answer_with(0, &[]);
    }

    fn data_command(&mut self, now_ns: u64, number: u8, argument: u32) {
        let by_bytes = self.model.kind.by_bytes();
        let at = if by_bytes { argument / 512 } else { argument };
        match number {
            16 => self.answer_with(if argument == 512 { 0 } else { PARAMETER }, &[]),
            17 | 18 | 24 | 25 if by_bytes && !argument.is_multiple_of(512) => self.answer_with(ADDRESS, &[]),
            17 | 18 | 24 | 25 if at >= self.model.medium.size() => self.answer_with(PARAMETER, &[]),
            9 => self.send(now_ns, &self.model.csd(), 0),
            10 => self.send(now_ns, &self.model.cid(), 0),
            17 => self.send(now_ns, &self.model.medium.get(at), self.model.read_ns),
            18 => {
                self.transfer = Transfer::Read { next: at + 1 };
                let data = self.model.medium.get(at);
                self.send(now_ns, &data, self.model.read_ns);
            }
            24 | 25 => {
                self.answer_with(0, &[]);
                // Undefined until written (4.3.4): here erased.
                let count = if number == 25 { std::mem::take(&mut self.erases) } else { 0 };
                let end = at.saturating_add(count).min(self.model.medium.size());
                (at..end).for_each(|at| self.model.medium.erase(at));
                self.transfer = Transfer::Write { many: number == 25, at, block: None, failed: false };
            }
            _ => self.answer_with(ILLEGAL, &[]),
        }
    }

    fn answer_with(&mut self, bits: u8, more: &[u8]) {
        self.out.push_back(0xFF);
        self.out.push_back(bits | u8::from(self.state == State::Idle));
        if bits == 0 {
            self.out.extend(more);
        }
    }

    fn send(&mut self, now_ns: u64, data: &[u8], after_ns: u64) {
        self.answer_with(0, &[]);
        if self.model.has(now_ns, |fault| fault == Fault::NoBlock).is_some() {
            return;
        }
        if let Some(Fault::Token(token)) = self.model.has(now_ns, |fault| matches!(fault, Fault::Token(_))) {
            self.pending = Some((now_ns + after_ns, vec![token]));
            return;
        }
        let bytes = self.block(now_ns, data);
        self.pending = Some((now_ns + after_ns, bytes));
    }

    fn block(&mut self, now_ns: u64, data: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0xFE];
        bytes.extend(data);
        bytes.extend(crc16(data).to_be_bytes());
        if self.model.has(now_ns, |fault| fault == Fault::DamagedRead).is_some() {
            bytes[7] ^= 0x10;
        }
        bytes
    }

    fn write_block(&mut self, now_ns: u64) {
        let Transfer::Write { many, at, block, failed } = &mut self.transfer else { return };
        let taken = block.take().unwrap_or_default();
        let (data, sum) = taken.split_at(512);
        let is_whole = !self.checks || crc16(data).to_be_bytes() == sum;
        let model = &mut self.model;
        let is_damaged = model.has(now_ns, |fault| fault == Fault::DamagedWrite).is_some();
        let is_locked = model.locked.0 || model.locked.1;
        self.programmed = None;
        let (mut response, mut busy_ns) = (0xE5, if *many { model.write_ns.1 } else { model.write_ns.0 });
        if *failed || !is_whole || is_damaged {
            (response, busy_ns, *failed) = (0xEB, 0, true);
        } else if is_locked || *at >= model.medium.size() {
            self.status |= if is_locked { STATUS_LOCKED } else { STATUS_ERROR };
            (response, busy_ns, *failed) = (0xED, 0, true);
        } else if model.has(now_ns, |fault| fault == Fault::WriteError).is_some() {
            self.status |= STATUS_ERROR;
            (response, busy_ns, *failed) = (0xED, 0, true);
        } else {
            if model.has(now_ns, |fault| fault == Fault::NotProgrammed).is_some() {
                self.status |= STATUS_ERROR;
            } else if let Ok(data) = data.try_into() {
                self.programmed = Some((*at, model.medium.get(*at)));
                model.medium.set(*at, data);
            }
            if let Some(Fault::Busy(ns)) = model.has(now_ns, |fault| matches!(fault, Fault::Busy(_))) {
                busy_ns = ns;
            }
        }
        *at += 1;
        if !*many {
            self.transfer = Transfer::None;
        }
        self.out.push_back(response);
        self.busy_until_ns = now_ns.saturating_add(busy_ns);
    }

    /// Usual cards, without random long waits.
    pub(crate) const POWER_UP_NS: u64 = MS;
}
