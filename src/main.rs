//! The `tenter` command: everything is in the library.

fn main() -> std::process::ExitCode {
    tenter::cli::main()
}
