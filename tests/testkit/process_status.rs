//! What Linux says of a process in `/proc`.

/// A figure of `/proc/PROCESS/status`, such as `VmRSS:` (resident memory, kB), `VmHWM:` (the greatest so far, kB) or `Threads:`. `process` is its
/// number, or `self`. `None` where the process or the figure is not there.
pub fn status_figure(process: &str, name: &str) -> Option<f64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse().ok()
}
