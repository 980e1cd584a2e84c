#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <mutex>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/priors/sam/decoder_network.h"
#include "core/priors/sam/encoder_network.h"
#include "core/priors/sam/prompted_segmenter.h"
#include "kernels/backend.h"

namespace pepeseg {

// SAM's networks on the kernels of a backend of their own, whose work runs next to that of other
// backends of the device. Thread-safe: one call computes at a time, and the others wait.
class DeviceSam {
 public:
  // Loads encoder.onnx and sam.onnx of the folder to a CUDA device; their digests are for the
  // caller to verify. Returns UNAVAILABLE when there is no such device, FAILED_PRECONDITION with
  // the file's name when it is not the expected model, and RESOURCE_EXHAUSTED when out of memory.
  static absl::StatusOr<std::unique_ptr<DeviceSam>> Open(const std::filesystem::path& folder,
                                                         int cuda_device);
  // The same to a CPU backend of `num_threads` threads, in floats.
  static absl::StatusOr<std::unique_ptr<DeviceSam>> OpenOnCpu(const std::filesystem::path& folder,
                                                              int num_threads);
  // Takes networks of any source. The encoder's embedding has the decoder's places and channels,
  // and both are on `backend`.
  DeviceSam(std::unique_ptr<Backend> backend, std::unique_ptr<EncoderNetwork> encoder,
            std::unique_ptr<DecoderNetwork> decoder);
  ~DeviceSam();

  // Returns a segmenter for the photographs of one thread, which must not outlive this. The masks
  // of a photograph do not depend on what other segmenters do. Its calls return RESOURCE_EXHAUSTED
  // when the device is out of memory, INTERNAL when it fails otherwise, and CANCELLED after
  // Interrupt.
  std::unique_ptr<PromptedSegmenter> MakeSegmenter();

  // Returns the embedding of an RGB photograph, [places, channels].
  absl::StatusOr<NetworkBuffer> Embed(const Image& photo);
  // Runs `calls`, which uses the networks and the backend, alone, and returns its error or the
  // backend's. Waits for the device.
  absl::Status Run(absl::FunctionRef<absl::Status()> calls);

  // Makes all present and later calls return CANCELLED, each after at most the work of one call of
  // a segmenter: some milliseconds. Any thread may call it.
  void Interrupt() { interrupted_ = true; }

  Backend& backend() { return *backend_; }
  EncoderNetwork& encoder() { return *encoder_; }
  DecoderNetwork& decoder() { return *decoder_; }

 private:
  std::unique_ptr<Backend> backend_;
  std::mutex mutex_;  // guards the networks and the backend's error
  std::unique_ptr<EncoderNetwork> encoder_;
  std::unique_ptr<DecoderNetwork> decoder_;
  std::atomic<bool> interrupted_ = false;
};

}  // namespace pepeseg
