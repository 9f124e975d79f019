//! Windows closes the console of a program that Explorer started (dropped files) when it ends.

/// Waits for Enter if no other program (a shell) shares this console. Not for commands: a scheduled one must not wait.
#[cfg(windows)]
pub fn hold() {
    use std::io::{self, IsTerminal as _};
    use windows_sys::Win32::System::Console::GetConsoleProcessList;

    let mut processes = [0_u32; 2];
    // SAFETY: it writes at most as many numbers as it has room for.
    let count = unsafe { GetConsoleProcessList(processes.as_mut_ptr(), processes.len() as u32) };
    if count == 1 && io::stdin().is_terminal() && io::stderr().is_terminal() {
        crate::output::aside("\nPress Enter to close this window.");
        let _ = io::stdin().read_line(&mut String::new());
    }
}

/// Other systems keep it.
#[cfg(not(windows))]
pub const fn hold() {}
