//! Stack depth of each exception, as a painted stack would show it, without a change of the program.

/// One that was entered and has not returned.
#[derive(Clone, Copy, Debug)]
struct Level {
    exception: u16,
    /// The stack pointer before its frame.
    begin: u32,
    /// The lowest stack pointer of the interrupted code until then.
    interrupted: u32,
}

/// The main stack's use.
#[derive(Clone, Debug, Default)]
pub(crate) struct Depths {
    /// The lowest stack pointer of the running code.
    pub(crate) lowest: u32,
    /// The stack pointer and [`Depths::lowest`] at an entry.
    entering: (u32, u32),
    /// Thread mode first.
    levels: Vec<Level>,
    deepest: Vec<u32>,
}

impl Depths {
    /// A reset with this stack pointer.
    pub(crate) fn begin(&mut self, stack: u32) {
        self.levels.clear();
        self.levels.push(Level { exception: 0, begin: stack, interrupted: stack });
        self.lowest = stack;
    }

    /// An entry begins, with the stack pointer as it was before the frame.
    pub(crate) fn interrupted(&mut self, stack: u32) {
        self.note();
        self.entering = (stack, self.lowest);
    }

    /// The exception was chosen, and its frame is there.
    pub(crate) fn entered(&mut self, exception: u16, stack: u32) {
        let (begin, interrupted) = self.entering;
        self.levels.push(Level { exception, begin, interrupted });
        self.lowest = stack;
    }

    /// It returns; another one may take over its frame.
    pub(crate) fn returned(&mut self) {
        self.note();
        if let Some(level) = self.levels.pop() {
            self.entering = (level.begin, level.interrupted);
        }
    }

    /// Returns to the interrupted code.
    pub(crate) fn resumed(&mut self) {
        self.lowest = self.entering.1;
    }

    /// The bytes of an exception's deepest.
    pub(crate) fn of(&self, exception: u16) -> u32 {
        self.deepest.get(usize::from(exception)).copied().unwrap_or(0)
    }

    fn note(&mut self) {
        let Some(level) = self.levels.last() else { return };
        let place = usize::from(level.exception);
        if self.deepest.len() <= place {
            self.deepest.resize(place + 1, 0);
        }
        self.deepest[place] = self.deepest[place].max(level.begin.saturating_sub(self.lowest));
    }
}
