//! Stack depth by exception, as a painted stack shows it.

/// Entered and not returned.
#[derive(Clone, Copy, Debug)]
struct Level {
    exception: u16,
    /// The stack pointer before its frame.
    begin: u32,
    /// Stack of the interrupted code until then.
    interrupted: u32,
}

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
    pub(crate) fn begin(&mut self, stack: u32) {
        self.note();
        self.levels.clear();
        self.levels.push(Level { exception: 0, begin: stack, interrupted: stack });
        self.lowest = stack;
    }

    /// `stack`: before the frame.
    pub(crate) fn interrupted(&mut self, stack: u32) {
        self.note();
        self.entering = (stack, self.lowest);
    }

    /// Chosen, with its frame.
    pub(crate) fn entered(&mut self, exception: u16, stack: u32) {
        let (begin, interrupted) = self.entering;
        self.levels.push(Level { exception, begin, interrupted });
        self.lowest = stack;
    }

    /// Another one may take over its frame.
    pub(crate) fn returned(&mut self) {
        self.note();
        if let Some(level) = self.levels.pop() {
            self.entering = (level.begin, level.interrupted);
        }
    }

    pub(crate) fn resumed(&mut self) {
        self.lowest = self.entering.1;
    }

    /// Bytes at its deepest.
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
