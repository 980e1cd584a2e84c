#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/priors/sam/encoder_network.h"
#include "kernels/backend.h"
#include "kernels/network_buffer.h"

namespace pepeseg {

struct DecoderLayers;

// A point of a prompt, in pixels of SAM's frame, whose first pixel has its centre at 0.
struct DecoderPoint {
  float x = 0, y = 0;
  int32_t label = -1;  // -1: padding, 0: outside the mask, 1: inside, 2 and 3: corners of a box
};

// Cells of the decoder's square of masks that show the photograph: those from the first on.
struct DecoderGrid {
  int width = 0, height = 0;
};

// The decoder's answers to prompts, on the backend. Masks of a prompt follow each other; they are
// squares of cells, `extent` a side.
struct DecodedMasks {
  int num_prompts = 0;
  Buffer<float> ious;       // [prompts, 4] estimated IoUs
  Buffer<int8_t> quarters;  // [prompts, 4, extent, extent] logits in quarters, within +-127
  Buffer<uint32_t> bits;    // [prompts, 4, extent, extent / 32] logit > 0, only within the grid
  Buffer<int32_t> areas;    // [prompts, 4, 3] cells of the grid with logits over -1, 0 and 1
  Buffer<float> logits;     // [prompts, 4, extent, extent]; empty unless asked for
};

// The decoder of a small SAM on a backend's own kernels (kernels/ops/prompt_network.h). Not
// thread-safe.
class DecoderNetwork {
 public:
  // Loads the weights from sam.onnx; its digest is for the caller to verify. `backend` must outlive
  // the network; CUDA takes Precision::kHalf only. Returns FAILED_PRECONDITION with the file's name
  // when it is not the expected model, and RESOURCE_EXHAUSTED when the backend is out of memory.
  static absl::StatusOr<std::unique_ptr<DecoderNetwork>> Load(const std::filesystem::path& onnx,
                                                              Backend& backend,
                                                              Precision precision);
  // The same with weights of any source, for an embedding of side x side places: 8, 16, 32 or 64.
  static absl::StatusOr<std::unique_ptr<DecoderNetwork>> Make(int side, WeightSource weights,
                                                              Backend& backend,
                                                              Precision precision);
  ~DecoderNetwork();

  // Sides of the embedding and of the masks, places and cells, and of the frame, pixels.
  int side() const;
  int extent() const { return 4 * side(); }
  int frame() const { return 16 * side(); }
  Precision precision() const;

  // Answers prompts for the photograph with this embedding, [places, 256]. All prompts have
  // `num_points` points. Does not wait for the device, unless a buffer grows. Returns
  // RESOURCE_EXHAUSTED when the backend is out of memory, and INTERNAL for other errors of it; the
  // backend then keeps the error.
  absl::Status Decode(ConstNetworkSpan embedding, std::span<const DecoderPoint> points,
                      int num_points, const DecoderGrid& grid, bool with_logits,
                      DecodedMasks& masks);
  // The same for one prompt of points and a mask: logits
  // [extent, extent], which take the place of the embedding of "no mask". Returns also
  // INVALID_ARGUMENT for a mask of another size.
  absl::Status DecodeWithMask(ConstNetworkSpan embedding, std::span<const DecoderPoint> points,
                              std::span<const float> mask, const DecoderGrid& grid,
                              DecodedMasks& masks);

  // From now on Decode returns CANCELLED, after at most the prompts that it computes at the same
  // time, once the flag is true. The flag must outlive the network.
  void EndWhen(const std::atomic<bool>* flag) { end_ = flag; }

 private:
  struct Scratch;
  explicit DecoderNetwork(std::unique_ptr<DecoderLayers> layers);
  absl::Status Run(std::span<const DecoderPoint> points, int num_points, const DecoderGrid& grid,
                   bool with_logits, DecodedMasks& masks);

  void RunChunk(int first, int num_prompts, int num_points, const DecoderGrid& grid,
                DecodedMasks& masks);

  std::unique_ptr<DecoderLayers> layers_;
  std::unique_ptr<Scratch> scratch_;
  const std::atomic<bool>* end_ = nullptr;
};

// Returns the prompts that Decode computes at the same time. In floats the CPU computes: more
// prompts would only take memory there, 4 MB of places each.
constexpr int DecodedAtOnce(Precision precision) { return precision == Precision::kHalf ? 128 : 4; }

}  // namespace pepeseg
