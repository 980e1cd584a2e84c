#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/priors/sam/onnx_graph.h"
#include "core/priors/sam/onnx_runtime.h"
#include "core/scene/capture.h"

// The files of a small SAM with TinyViT's encoder, and how its networks are run.
namespace pepeseg {

// Verifies the three files of a folder that deploy/sam.sh has made (encoder, decoder, ONNX Runtime)
// against its SHA256SUMS, which has a line "DIGEST  NAME" for each. Returns NOT_FOUND when the
// folder or its SHA256SUMS does not exist, and FAILED_PRECONDITION, with the file and the remedy,
// when a file is missing or differs. Reads 90 MB.
absl::Status CheckSamFiles(const std::filesystem::path& folder);

inline constexpr int kSamFrame = 1024;  // side of the encoder's square image, pixels
// Tensors of the decoder's graph: all four masks, [prompts, 4, 256, 256], and their estimated IoUs,
// [prompts, 4].
inline constexpr char kSamMasks[] = "/Reshape_9_output_0";
inline constexpr char kSamIous[] = "/iou_prediction_head/layers.2/Gemm_output_0";

// The networks, ready to run.
struct SamNetworks {
  // Verifies the files and loads the networks, with the decoder's graph changed by `edit`. A
  // session computes on the CPU if the GPU of `options`, or ONNX Runtime's CUDA provider in the
  // folder, does not work. Returns the errors of CheckSamFiles, FAILED_PRECONDITION when the
  // library does not load or the models are not the expected ones, and RESOURCE_EXHAUSTED when out
  // of memory.
  static absl::StatusOr<std::unique_ptr<const SamNetworks>> Open(
      const std::filesystem::path& folder, const OnnxGraphEdit& edit,
      const OnnxSessionOptions& options);

  std::unique_ptr<OnnxRuntime> runtime;
  std::unique_ptr<OnnxSession> encoder, decoder;
  std::string processor;  // as SamModel::processor()
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
