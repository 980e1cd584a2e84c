#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/onnx/onnx_runtime.h"
#include "core/priors/sam/onnx_graph.h"
#include "core/scene/capture.h"

// The files of a small SAM with TinyViT's encoder, and its networks in ONNX Runtime.
namespace pepeseg {

// Files of a folder that deploy/sam.sh has made.
inline constexpr char kSamEncoder[] = "encoder.onnx", kSamDecoder[] = "sam.onnx";

// Verifies the three files of a folder that deploy/sam.sh has made (encoder, decoder, ONNX Runtime)
// against its SHA256SUMS, which has a line "DIGEST  NAME" for each. Returns NOT_FOUND when the
// folder or its SHA256SUMS does not exist, and FAILED_PRECONDITION, with the file and the remedy,
// when a file is missing or differs. Reads 90 MB.
absl::Status CheckSamFiles(const std::filesystem::path& folder);

// Returns the SHA-256 of the encoder as SHA256SUMS has it: embeddings are of one encoder.
// Returns the errors of CheckSamFiles.
absl::StatusOr<std::string> SamEncoderDigest(const std::filesystem::path& folder);

inline constexpr int kSamFrame = 1024;  // side of the encoder's square image, pixels
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
