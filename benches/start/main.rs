//! From the start of the program to its first picture in a window, the memory that it holds at rest, and its size. The window
//! opens on a virtual display (Xvfb) and is drawn by whatever adapter there is.

#[cfg(target_os = "linux")]
mod measure;

fn main() {
    #[cfg(target_os = "linux")]
    measure::all();
}
