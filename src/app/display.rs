//! Asks whether a window can be opened at all, before the window library finds out in its own words or by a panic.

/// Why no window can be opened; each message is one line that says what would help.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoDisplay {
    /// No window system.
    #[error(
        "no window can be opened: neither DISPLAY nor WAYLAND_DISPLAY is set; start it in a desktop session"
    )]
    NotSet,
    /// A library that the window system needs is missing.
    #[error(
        "no window can be opened: {0} is missing (Debian, Ubuntu: apt install libxkbcommon0 libxkbcommon-x11-0 libxcursor1 libxi6)"
    )]
    Library(&'static str),
    /// The window system does not answer.
    #[error("no window can be opened: the display {0:?} does not answer; start it in a desktop session")]
    Silent(String),
}

/// Looks at the environment and for the libraries that would be missed by a panic.
///
/// # Errors
/// [`NoDisplay`] if a window cannot be opened.
#[cfg(target_os = "linux")]
pub fn probe() -> Result<(), NoDisplay> {
    let session = session(|name| std::env::var(name).ok())?;
    if xkbcommon_dl::xkbcommon_option().is_none() {
        return Err(NoDisplay::Library("libxkbcommon"));
    }
    if session == Session::X11 && xkbcommon_dl::x11::xkbcommon_x11_option().is_none() {
        return Err(NoDisplay::Library("libxkbcommon-x11"));
    }
    Ok(())
}

/// Elsewhere the system always has a window to give.
///
/// # Errors
/// None.
#[cfg(not(target_os = "linux"))]
pub fn probe() -> Result<(), NoDisplay> {
    Ok(())
}

/// The display that was asked for, for messages.
pub fn name() -> String {
    let set = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    set("WAYLAND_DISPLAY").or_else(|| set("DISPLAY")).unwrap_or_default()
}

#[cfg(target_os = "linux")]
#[derive(Debug, PartialEq, Eq)]
enum Session {
    Wayland,
    X11,
}

/// The same choice as winit's.
#[cfg(target_os = "linux")]
fn session(variable: impl Fn(&str) -> Option<String>) -> Result<Session, NoDisplay> {
    let set = |name: &str| variable(name).is_some_and(|value| !value.is_empty());
    if set("WAYLAND_DISPLAY") || set("WAYLAND_SOCKET") {
        Ok(Session::Wayland)
    } else if set("DISPLAY") {
        Ok(Session::X11)
    } else {
        Err(NoDisplay::NotSet)
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn the_session_is_read_from_the_environment() {
        let with = |names: &'static [&str]| session(|name| names.contains(&name).then(|| ":0".to_owned()));
        assert_eq!(with(&[]), Err(NoDisplay::NotSet));
        assert_eq!(with(&["DISPLAY"]), Ok(Session::X11));
        assert_eq!(with(&["DISPLAY", "WAYLAND_DISPLAY"]), Ok(Session::Wayland));
        assert_eq!(session(|_| Some(String::new())), Err(NoDisplay::NotSet));
    }

    #[test]
    fn every_message_is_one_line() {
        for error in [NoDisplay::NotSet, NoDisplay::Library("x"), NoDisplay::Silent(":7\n".to_owned())] {
            assert!(!error.to_string().contains('\n'));
        }
    }
}
