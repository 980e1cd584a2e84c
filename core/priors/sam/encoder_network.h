#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/capture.h"
#include "kernels/backend.h"
#include "kernels/network_buffer.h"

namespace pepeseg {

// Sizes of a TinyViT encoder (Wu et al. 2022) as SAM's small variants have it; the defaults are
// those of the file encoder.onnx of deploy/sam.sh. Stage 0 is made of convolutions, stages 1 to 3
// of attention within windows. Their images have frame / 4, / 8, / 16 and / 16 places along a side.
struct EncoderShape {
  int frame = 1024;  // side of the square input, pixels
  std::array<int, 4> channels = {64, 128, 160, 320};
  std::array<int, 4> blocks = {2, 2, 6, 2};
  std::array<int, 4> window = {0, 7, 14, 7};  // side, places
  std::array<int, 4> heads = {0, 4, 5, 10};
  int embedding = 256;  // channels

  // Places along a side of the embedding.
  int grid() const { return frame / 16; }
  // Values of the embedding of a photograph.
  int64_t embedding_size() const { return int64_t{grid()} * grid() * embedding; }
};

// Returns the values of input `index` of the node of encoder.onnx that makes tensor `output`, which
// must have this shape, or an error.
using WeightSource = absl::FunctionRef<absl::StatusOr<std::vector<float>>(
    absl::string_view output, int index, std::span<const int64_t> shape)>;

// The encoder of a small SAM on a backend's own kernels. Not thread-safe.
class EncoderNetwork {
 public:
  // Loads the weights from encoder.onnx; its digest is for the caller to verify. `backend` must
  // outlive the network; the CPU backend takes Precision::kFloat only. Returns FAILED_PRECONDITION
  // with the file's name when it is not the expected model, and RESOURCE_EXHAUSTED when the backend
  // is out of memory.
  static absl::StatusOr<std::unique_ptr<EncoderNetwork>> Load(const std::filesystem::path& onnx,
                                                              Backend& backend,
                                                              Precision precision);
  // The same with weights and sizes of any source.
  static absl::StatusOr<std::unique_ptr<EncoderNetwork>> Make(const EncoderShape& shape,
                                                              WeightSource weights,
                                                              Backend& backend,
                                                              Precision precision);
  ~EncoderNetwork();

  // Computes the embeddings of RGB photographs, [photos, places, channels] in reading order; sized
  // by the call. A photograph has the same bytes alone or among others. Does not wait for the
  // device. Returns RESOURCE_EXHAUSTED when the backend is out of memory; the backend then keeps
  // the error, see Backend.
  absl::Status Encode(std::span<const Image* const> photos, NetworkBuffer* embeddings);

  const EncoderShape& shape() const;

 private:
  struct Layers;
  explicit EncoderNetwork(std::unique_ptr<Layers> layers);
  std::unique_ptr<Layers> layers_;
};

}  // namespace pepeseg
