#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/priors/sam/prompted_segmenter.h"

namespace pepeseg {

class CpuSam;
class DeviceSam;
struct SamNetworks;

// Verifies the three files of a folder that deploy/sam.sh has made (encoder, decoder, ONNX Runtime)
// against its SHA256SUMS, which has a line "DIGEST  NAME" for each. Returns NOT_FOUND when the
// folder or its SHA256SUMS does not exist, and FAILED_PRECONDITION, with the file and the remedy,
// when a file is missing or differs. Reads 90 MB.
absl::Status CheckSamFiles(const std::filesystem::path& folder);

// Returns the SHA-256 of the encoder as SHA256SUMS has it: embeddings are of one encoder.
// Returns the errors of CheckSamFiles.
absl::StatusOr<std::string> SamEncoderDigest(const std::filesystem::path& folder);

inline constexpr int kSamFrame = 1024;  // side of the encoder's square image, pixels

// Returns the number of photographs to segment at the same time on `num_threads` threads. On the
// CPU a thread for each takes less processor time than several that share one, but each takes
// memory. On a GPU one is computed at a time, while other threads decode photographs and write
// masks.
constexpr int SamPhotographsAtOnce(int num_threads, bool on_device = false) {
  return std::clamp(num_threads, 1, on_device ? 8 : 4);
}

// Returns an upper estimate of the host memory that SAM takes on `num_threads` threads, bytes.
// Measured: 591, 1006 and 1870 MiB for 1, 2 and 4 photographs at a time on the CPU.
constexpr int64_t SamHostBytes(int num_threads) {
  return (int64_t{200} << 20) + (int64_t{430} << 20) * SamPhotographsAtOnce(num_threads);
}

// Returns an upper estimate of the device memory that SAM takes on CUDA for photographs of up to
// this many pixels, bytes, however many threads segment. Measured:
// tests/bench/results/sam_cuda.md.
constexpr int64_t SamDeviceBytes(int64_t max_pixels) {
  return (int64_t{700} << 20) + 8 * max_pixels;
}

// Time that the masks of a photograph of any size take with the default AutomaticMaskOptions,
// seconds of one core (x86-64 with AVX-512): tests/bench/results/estimates.md.
inline constexpr double kSamCoreSeconds = 8;
// On a GPU: seconds of an H200, and of a core that decodes a photograph of 2 megapixels and writes
// its masks meanwhile. Measured: tests/bench/results/sam_cuda.md.
inline constexpr double kSamDeviceSeconds = 0.01, kSamHostSeconds = 0.1;

// Returns the time that one of many photographs takes on `num_threads` threads, seconds.
constexpr double SamSeconds(int num_threads, bool on_device) {
  if (!on_device) return kSamCoreSeconds / num_threads;
  return std::max(kSamDeviceSeconds, kSamHostSeconds / SamPhotographsAtOnce(num_threads, true));
}

struct SamOptions {
  int num_threads = 1;  // of the CPU
  // CUDA's number of the GPU that computes, if it can. Absent: the CPU computes.
  std::optional<int> cuda_device = std::nullopt;
  // Called before the networks are opened for the CPU, on the thread that opens them and whose
  // threads compute. May be null.
  std::function<void()> before_cpu = nullptr;
  // Computes by ONNX Runtime on the CPU, for comparisons.
  bool onnx_runtime = false;
  // Segmenters answer prompts by masks, too, one photograph at a time on all threads; those that
  // compute by ONNX Runtime then answer one prompt at a time.
  bool mask_prompts = false;
};

// The networks of a small SAM with TinyViT's encoder, from a folder that deploy/sam.sh has made, on
// our own kernels: on CUDA (device_sam.h), or on the CPU (cpu_sam.h), where at most
// SamPhotographsAtOnce() segmenters should work at the same time. Other networks with the same
// inputs and outputs run in ONNX Runtime on the CPU. Thread-safe.
class SamModel {
 public:
  // Verifies the files and loads the networks. Where CUDA fails, the CPU computes: see processor().
  // Returns the errors of SamNetworks::Open.
  static absl::StatusOr<std::unique_ptr<SamModel>> Open(const std::filesystem::path& folder,
                                                        const SamOptions& options);
  ~SamModel();

  // SHA-256 of encoder.onnx: embeddings of models with the same one can be exchanged.
  const std::string& encoder_digest() const { return encoder_digest_; }
  // Returns "the CPU", "CUDA device 0", or "the CPU, since CUDA failed: ..." with the reason.
  std::string processor() const;
  // Most device memory that CUDA has taken so far, bytes.
  int64_t peak_device_bytes() const;
  // True while CUDA computes. It ends when a segmenter finds the device out of memory or broken.
  bool on_device() const;
  // True if CUDA was asked for and has failed.
  bool cuda_failed() const;

  // Returns a segmenter for the photographs of one thread. The model must outlive it. It goes over
  // to the CPU by itself.
  std::unique_ptr<PromptedSegmenter> MakeSegmenter();

  // Makes all present and later calls to the model's segmenters return CANCELLED. Any thread may
  // call it.
  void Interrupt();

 private:
  SamModel(const std::filesystem::path& folder, const SamOptions& options);
  void OpenDevice();
  absl::Status OpenCpu();
  std::unique_ptr<PromptedSegmenter> MakeCpuSegmenter();  // with mutex_ held
  absl::StatusOr<std::unique_ptr<PromptedSegmenter>> LeaveDevice(const absl::Status& why);

  const std::filesystem::path folder_;
  const SamOptions options_;
  std::string encoder_digest_;  // set by Open
  std::mutex opening_;          // held while the CPU's networks are opened, which takes seconds
  mutable std::mutex mutex_;    // guards the members below
  std::unique_ptr<DeviceSam> device_;  // set by Open
  // At most one is set, once; none: CUDA computes.
  std::unique_ptr<CpuSam> cpu_;
  std::unique_ptr<const SamNetworks> networks_;
  std::string cuda_failure_;  // empty: none
  bool interrupted_ = false;
};

}  // namespace pepeseg
