//! The window and its event loop: events to egui, the content's picture beneath the panels, repaint when something changed.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use winit::{
    application::ApplicationHandler,
    dpi::LogicalSize,
    event::{StartCause, WindowEvent},
    event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy},
    window::{Window, WindowId},
};

use super::{
    display::{self, NoDisplay},
    gpu::{Attachments, Gpu, GpuError},
    graphics::Graphics,
};

/// Why the window did not open or closed by itself; one line.
#[derive(Debug, thiserror::Error)]
pub enum ShellError {
    /// There is no display.
    #[error(transparent)]
    Display(#[from] NoDisplay),
    /// Nothing can draw.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The window system refused.
    #[error("the window could not be opened: {0}")]
    Window(String),
}

/// What fills the window.
pub trait Content {
    /// Panels; called for every repaint, on the window's thread: it must not wait.
    fn ui(&mut self, ui: &mut egui::Ui);

    /// The device was lost, and there is another one: whatever lay on the old one is gone.
    fn attach(&mut self, stage: &Stage<'_>);

    /// Draws what lies beneath the panels; must clear the canvas.
    fn draw(&mut self, canvas: &mut Canvas<'_>);

    /// The window's cross was pressed: true closes it, false keeps it open (to ask about unsaved changes).
    fn close_requested(&mut self) -> bool;

    /// True once the window should close by itself.
    fn is_finished(&self) -> bool;
}

/// Where a content draws.
pub struct Canvas<'a> {
    /// The device.
    pub gpu: &'a Gpu,
    /// Takes the passes.
    pub encoder: &'a mut wgpu::CommandEncoder,
    /// The window's next picture.
    pub target: &'a wgpu::TextureView,
    /// Depth and samples in the window's size.
    pub attachments: &'a Attachments,
    /// Pixels per point.
    pub pixels_per_point: f32,
}

/// What a content is made with.
pub struct Stage<'a> {
    /// The device.
    pub gpu: &'a Gpu,
    /// Format of the canvas.
    pub format: wgpu::TextureFormat,
    /// Samples per pixel of the canvas.
    pub samples: u32,
    /// egui's state; its `request_repaint` wakes the window from any thread.
    pub egui: &'a egui::Context,
}

/// How the window opens.
#[derive(Clone, Debug, PartialEq)]
pub struct Opening {
    /// In the window's frame.
    pub title: String,
    /// Width and height inside of the frame, points.
    pub size: [f32; 2],
    /// Fills the screen.
    pub maximized: bool,
    /// Samples per pixel; `None` lets the adapter decide.
    pub samples: Option<u32>,
}

/// Opens a window and returns when it is closed.
///
/// # Errors
/// [`ShellError`] if it cannot open, or the device is lost and there is no other.
pub fn run<C: Content>(opening: Opening, build: impl FnOnce(&Stage<'_>) -> C) -> Result<(), ShellError> {
    display::probe()?;
    let mut builder = EventLoop::<Wake>::with_user_event();
    #[cfg(all(target_os = "linux", feature = "app-test"))]
    // Tests run on threads of their own.
    winit::platform::x11::EventLoopBuilderExtX11::with_any_thread(&mut builder, true);
    let event_loop = builder.build().map_err(|_| NoDisplay::Silent(display::name()))?;
    let mut shell =
        Shell { opening, build: Some(build), proxy: event_loop.create_proxy(), open: None, error: None };
    let ended = event_loop.run_app(&mut shell);
    match shell.error {
        Some(error) => Err(error),
        None => ended.map_err(|error| ShellError::Window(one_line(&error))),
    }
}

fn one_line(error: &impl std::fmt::Display) -> String {
    error.to_string().replace('\n', " ")
}

/// Another thread, or egui itself, wants a repaint.
struct Wake {
    at: Instant,
}

struct Shell<C, B> {
    opening: Opening,
    build: Option<B>,
    proxy: EventLoopProxy<Wake>,
    open: Option<Open<C>>,
    error: Option<ShellError>,
}

/// An open window. Fields are dropped in this order: what lies on the device before the device.
struct Open<C> {
    content: C,
    egui: egui_winit::State,
    viewport: egui::ViewportInfo,
    graphics: Graphics,
    window: Arc<Window>,
    repaint_at: Option<Instant>,
    /// When the next picture may be drawn that no key and no mouse asks for.
    rested_at: Instant,
}

/// The smallest window, logical pixels.
const LEAST: [f32; 2] = [640.0, 400.0];

impl<C: Content, B: FnOnce(&Stage<'_>) -> C> Shell<C, B> {
    fn open(&mut self, event_loop: &ActiveEventLoop, build: B) -> Result<Open<C>, ShellError> {
        let [mut width, mut height] = self.opening.size;
        // No larger than the screen, which not every window manager sees to.
        if let Some(screen) = event_loop.primary_monitor().or_else(|| event_loop.available_monitors().next())
        {
            let room = screen.size().to_logical::<f32>(screen.scale_factor());
            (width, height) = (width.min(room.width.max(LEAST[0])), height.min(room.height.max(LEAST[1])));
        }
        let attributes = Window::default_attributes()
            .with_title(&self.opening.title)
            .with_inner_size(LogicalSize::new(width, height))
            .with_min_inner_size(LogicalSize::new(LEAST[0], LEAST[1]))
            .with_maximized(self.opening.maximized);
        let window = event_loop
            .create_window(attributes)
            .map(Arc::new)
            .map_err(|error| ShellError::Window(one_line(&error)))?;
        let display = event_loop.owned_display_handle();
        let graphics = Graphics::new(Arc::clone(&window), display, self.opening.samples)?;
        let context = egui::Context::default();
        let proxy = self.proxy.clone();
        context.set_request_repaint_callback(move |info| {
            if let Some(at) = Instant::now().checked_add(info.delay) {
                // The window may be gone already; then nobody needs the repaint.
                let _ = proxy.send_event(Wake { at });
            }
        });
        let egui = egui_winit::State::new(
            context.clone(),
            egui::ViewportId::ROOT,
            &window,
            Some(window.scale_factor() as f32),
            window.theme(),
            graphics.texture_limit(),
        );
        let content = build(&graphics.stage(&context)?);
        Ok(Open {
            content,
            egui,
            viewport: egui::ViewportInfo::default(),
            graphics,
            window,
            repaint_at: Some(Instant::now()),
            rested_at: Instant::now(),
        })
    }
}

impl<C: Content, B: FnOnce(&Stage<'_>) -> C> ApplicationHandler<Wake> for Shell<C, B> {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        let Some(build) = self.build.take() else { return };
        match self.open(event_loop, build) {
            Ok(open) => self.open = Some(open),
            Err(error) => {
                self.error = Some(error);
                event_loop.exit();
            }
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, cause: StartCause) {
        if let (StartCause::ResumeTimeReached { .. }, Some(open)) = (cause, &self.open) {
            open.window.request_redraw();
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, wake: Wake) {
        if let Some(open) = &mut self.open {
            open.repaint_by(wake.at.max(open.rested_at));
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        if matches!(event, WindowEvent::RedrawRequested) {
            open.redraw(event_loop);
            if let Err(error) = open.recover() {
                self.error = Some(error.into());
                event_loop.exit();
            } else if open.content.is_finished() {
                event_loop.exit();
            }
            return;
        }
        if open.egui.on_window_event(&open.window, &event).repaint {
            open.repaint_by(Instant::now());
        }
        match event {
            WindowEvent::CloseRequested => {
                if open.content.close_requested() {
                    event_loop.exit();
                }
                open.repaint_by(Instant::now());
            }
            WindowEvent::Resized(_) => {
                open.graphics.resize();
                open.repaint_by(Instant::now());
            }
            WindowEvent::Occluded(false) => open.repaint_by(Instant::now()),
            _ => {}
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let Some(open) = &self.open else { return };
        match open.repaint_at {
            Some(at) if at <= Instant::now() => {
                open.window.request_redraw();
                // Until the system asks for the picture there is nothing to do, also when that takes long.
                event_loop.set_control_flow(ControlFlow::Wait);
            }
            Some(at) => event_loop.set_control_flow(ControlFlow::WaitUntil(at)),
            None => event_loop.set_control_flow(ControlFlow::Wait),
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        // Here and not with the shell: the window's resources must go while the display is still there.
        self.open = None;
    }
}

/// A window that cannot be drawn now is tried again after this time, not at once: nothing would have changed.
const RETRY: Duration = Duration::from_millis(100);

impl<C: Content> Open<C> {
    fn repaint_by(&mut self, at: Instant) {
        self.repaint_at = Some(self.repaint_at.map_or(at, |planned| planned.min(at)));
    }

    fn redraw(&mut self, event_loop: &ActiveEventLoop) {
        self.repaint_at = None;
        let start = Instant::now();
        let size = self.window.inner_size();
        if size.width == 0 || size.height == 0 {
            return;
        }
        let output = self.run_ui(event_loop);
        let pixels_per_point = output.pixels_per_point;
        let mut textures = output.textures_delta;
        self.graphics.set_textures(&mut textures);
        let shapes = self.egui.egui_ctx().tessellate(output.shapes, pixels_per_point);
        if !self.graphics.paint(&mut self.content, &shapes, pixels_per_point) {
            self.repaint_by(Instant::now() + RETRY);
        }
        self.graphics.free_textures(&mut textures);
        if self.graphics.is_software() {
            // The simulation needs the same cores: pictures get half of the time.
            self.rested_at = Instant::now() + start.elapsed();
        }
    }

    fn run_ui(&mut self, event_loop: &ActiveEventLoop) -> egui::FullOutput {
        let context = self.egui.egui_ctx().clone();
        egui_winit::update_viewport_info(&mut self.viewport, &context, &self.window, false);
        let mut input = self.egui.take_egui_input(&self.window);
        input.viewports.insert(egui::ViewportId::ROOT, self.viewport.clone());
        self.viewport.events.clear();
        let mut output = context.run_ui(input, |ui| self.content.ui(ui));
        let platform = std::mem::take(&mut output.platform_output);
        self.egui.handle_platform_output_with_event_loop(&self.window, event_loop, platform);
        if let Some(viewport) = output.viewport_output.remove(&egui::ViewportId::ROOT) {
            if let Some(at) = Instant::now().checked_add(viewport.repaint_delay) {
                self.repaint_by(at.max(self.rested_at));
            }
            let mut unused = Vec::new();
            egui_winit::process_viewport_commands(
                &context,
                &mut self.viewport,
                viewport.commands,
                &self.window,
                &mut unused,
            );
        }
        output
    }

    /// Goes on with another device where this one was lost.
    fn recover(&mut self) -> Result<(), GpuError> {
        if self.graphics.recover()? {
            let context = self.egui.egui_ctx().clone();
            self.content.attach(&self.graphics.stage(&context)?);
            self.repaint_by(Instant::now());
        }
        Ok(())
    }
}
