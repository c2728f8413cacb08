//! A buffer on the device that grows when it must and counts what is uploaded into it.

/// Bytes on the device.
pub(super) struct Buffer {
    label: &'static str,
    usage: wgpu::BufferUsages,
    pub(super) inner: wgpu::Buffer,
}

/// The shaders' arrays may not be empty.
const SMALLEST: u64 = 16;

impl Buffer {
    pub(super) fn new(device: &wgpu::Device, label: &'static str, usage: wgpu::BufferUsages) -> Self {
        let usage = usage | wgpu::BufferUsages::COPY_DST;
        Self { label, usage, inner: allocate(device, label, usage, SMALLEST) }
    }

    /// Makes the buffer exactly as long as `len` bytes: `arrayLength` in a shader then is the number of elements.
    /// True if it is a new buffer, so that bind groups which name it must be made again.
    pub(super) fn resize(&mut self, device: &wgpu::Device, len: u64) -> bool {
        let len = len.max(SMALLEST);
        let differs = self.inner.size() != len;
        if differs {
            self.inner = allocate(device, self.label, self.usage, len);
        }
        differs
    }

    /// Resizes and fills; true if it is a new buffer.
    pub(super) fn set<T: bytemuck::NoUninit>(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        content: &[T],
        uploaded: &mut u64,
    ) -> bool {
        let bytes: &[u8] = bytemuck::cast_slice(content);
        let new = self.resize(device, bytes.len() as u64);
        queue.write_buffer(&self.inner, 0, bytes);
        *uploaded += bytes.len() as u64;
        new
    }

    pub(super) fn binding(&self, binding: u32) -> wgpu::BindGroupEntry<'_> {
        wgpu::BindGroupEntry { binding, resource: self.inner.as_entire_binding() }
    }
}

fn allocate(device: &wgpu::Device, label: &str, usage: wgpu::BufferUsages, size: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage,
        mapped_at_creation: false,
    })
}
