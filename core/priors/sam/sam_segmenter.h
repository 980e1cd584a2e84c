#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "core/priors/sam/prompted_segmenter.h"

namespace pepeseg {

struct SamNetworks;

// Returns the number of photographs to segment at the same time on `num_threads` threads. A thread
// for each takes less processor time than several that share one, but each takes memory.
constexpr int SamPhotographsAtOnce(int num_threads) { return std::clamp(num_threads, 1, 4); }

// Returns an upper estimate of the host memory that SAM takes on `num_threads` threads, bytes.
// Measured: 591, 1006 and 1870 MiB for 1, 2 and 4 photographs at a time.
constexpr int64_t SamHostBytes(int num_threads) {
  return (int64_t{200} << 20) + (int64_t{430} << 20) * SamPhotographsAtOnce(num_threads);
}

// Time that the masks of a photograph of any size take with the default AutomaticMaskOptions,
// seconds of one core (x86-64 with AVX-512): tests/bench/results/sam_masks.md.
inline constexpr double kSamCoreSeconds = 12;

struct SamOptions {
  int num_threads = 1;
  // Photographs that the model's segmenters work on at the same time, at most `num_threads`. Each
  // is computed on the thread that calls its segmenter; the remaining threads help all of them.
  int photographs_at_once = 1;
  // GPU that computes, if the folder has ONNX Runtime's CUDA provider, which an operator may add to
  // it, and the provider works. Absent: only the CPU computes.
  std::optional<int> cuda_device = std::nullopt;
};

// The networks of a small SAM with TinyViT's encoder, from a folder that deploy/sam.sh has made.
class SamModel {
 public:
  // Returns the errors of SamNetworks::Open. Where CUDA fails, the CPU computes: see processor().
  static absl::StatusOr<std::unique_ptr<SamModel>> Open(const std::filesystem::path& folder,
                                                        const SamOptions& options);
  ~SamModel();

  // Returns "the CPU", "CUDA device 0", or "the CPU, since CUDA failed: ..." with the reason.
  const std::string& processor() const;

  // Returns a segmenter for the photographs of one thread. The model must outlive it.
  std::unique_ptr<PromptedSegmenter> MakeSegmenter() const;

  // Makes all present and later calls to the model's segmenters return CANCELLED. Any thread may
  // call it.
  void Interrupt() const;

 private:
  explicit SamModel(std::unique_ptr<const SamNetworks> networks);

  std::unique_ptr<const SamNetworks> networks_;
};

}  // namespace pepeseg
