#include "kernels/buffer.h"

#include <cstring>

#include "kernels/backend.h"

// Forwards to the Backend, so that buffer.h need not include backend.h, which includes it.

namespace pepeseg {

void* AllocateBytes(Backend& backend, size_t num_bytes) { return backend.Allocate(num_bytes); }
void FreeBytes(Backend& backend, void* data) { backend.Free(data); }
void* AllocatePinnedBytes(Backend& backend, size_t num_bytes) {
  void* data = backend.AllocatePinned(num_bytes);
  if (data != nullptr) std::memset(data, 0, num_bytes);
  return data;
}
void FreePinnedBytes(Backend& backend, void* data) { backend.FreePinned(data); }
void CopyToBackend(Backend& backend, void* to, const void* from_host, size_t num_bytes) {
  backend.CopyFromHost(to, from_host, num_bytes);
}
void CopyToHost(Backend& backend, void* to_host, const void* from, size_t num_bytes) {
  backend.CopyToHost(to_host, from, num_bytes);
}
void CopyInBackend(Backend& backend, void* to, const void* from, size_t num_bytes) {
  backend.Copy(to, from, num_bytes);
}
void ZeroBytes(Backend& backend, void* data, size_t num_bytes) { backend.Zero(data, num_bytes); }

}  // namespace pepeseg
