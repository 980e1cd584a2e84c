#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/onnx/onnx_runtime.h"
#include "core/priors/sam/onnx_graph.h"
#include "core/priors/sam/sam_segmenter.h"
#include "core/scene/capture.h"

// The files of a small SAM with TinyViT's encoder, and its networks in ONNX Runtime.
namespace pepeseg {

// Files of a folder that deploy/sam.sh has made.
inline constexpr char kSamEncoder[] = "encoder.onnx", kSamDecoder[] = "sam.onnx";

// Tensors of the decoder's graph: all four masks, [prompts, 4, 256, 256], and their estimated IoUs,
// [prompts, 4].
inline constexpr char kSamMasks[] = "/Reshape_9_output_0";
inline constexpr char kSamIous[] = "/iou_prediction_head/layers.2/Gemm_output_0";

// The networks in ONNX Runtime on the CPU, ready to run.
struct SamNetworks {
  // Loads the networks, with the decoder's graph changed by `edit`, from files that the caller has
  // verified. Returns FAILED_PRECONDITION when the library does not load or the models are not the
  // expected ones, and RESOURCE_EXHAUSTED when out of memory.
  static absl::StatusOr<std::unique_ptr<const SamNetworks>> Open(
      const std::filesystem::path& folder, const OnnxGraphEdit& edit,
      const OnnxSessionOptions& options);

  // As OnnxSession::Interrupt, for both networks.
  void Interrupt() const;

  std::unique_ptr<OnnxRuntime> runtime;
  std::unique_ptr<OnnxSession> encoder, decoder;
};

// Returns the photograph's embedding, [1, 256, 64, 64]: what the decoder needs of it. Returns the
// errors of OnnxSession::Run, and FAILED_PRECONDITION when the encoder is not the expected model.
absl::StatusOr<OnnxTensor> EmbedPhotograph(const OnnxSession& encoder, const Image& photo);
// Runs the decoder and returns kSamMasks and kSamIous of `num_prompts` prompts. Errors are those of
// EmbedPhotograph.
absl::StatusOr<std::vector<OnnxTensor>> RunSamDecoder(const OnnxSession& decoder,
                                                      std::span<const OnnxInput> inputs,
                                                      int64_t num_prompts);

}  // namespace pepeseg
