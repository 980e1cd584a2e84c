#include "core/priors/sam/sam_networks.h"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/onnx/installed_files.h"
#include "core/priors/sam/prompted_segmenter.h"

namespace pepeseg {
namespace {

constexpr int64_t kMaxModelBytes = int64_t{1} << 30;

// Returns the encoder's input, [3, kSamFrame, kSamFrame]: the photograph scaled so that its longer
// side fills the frame, normalised with the mean and standard deviation of SAM's training, with
// zeros to the right or below.
std::vector<float> EncoderInput(const Image& photo) {
  // RGB, of 255. Padding is 0 after normalising.
  constexpr std::array<float, 3> kMean = {123.675F, 116.28F, 103.53F};
  constexpr std::array<float, 3> kDeviation = {58.395F, 57.12F, 57.375F};
  const double scale = double{kSamFrame} / std::max(photo.width, photo.height);
  const cv::Mat from(photo.height, photo.width, CV_8UC3, const_cast<uint8_t*>(photo.pixels.data()));
  cv::Mat to;
  const cv::Size size(std::max(1, cvRound(photo.width * scale)),
                      std::max(1, cvRound(photo.height * scale)));
  // Area for shrinking; it would repeat pixels when enlarging.
  cv::resize(from, to, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
  std::vector<float> planes(size_t{3} * kSamFrame * kSamFrame, 0);
  for (int y = 0; y < to.rows; ++y) {
    const auto* row = to.ptr<cv::Vec3b>(y);
    for (int c = 0; c < 3; ++c) {
      float* out = &planes[(static_cast<size_t>(c) * kSamFrame + y) * kSamFrame];
      for (int x = 0; x < to.cols; ++x) out[x] = (row[x][c] - kMean[c]) / kDeviation[c];
    }
  }
  return planes;
}

// Opens a session on a model file, changed by `edit` unless it is null. A file that is not the
// expected model is FAILED_PRECONDITION.
absl::StatusOr<std::unique_ptr<OnnxSession>> OpenSession(const OnnxRuntime& runtime,
                                                         const std::filesystem::path& file,
                                                         const OnnxSessionOptions& options,
                                                         const OnnxGraphEdit* edit) {
  const std::string name = absl::StrCat("SAM: ", file.string());
  ASSIGN_OR_RETURN(std::string model, ReadFile(file, name, kMaxModelBytes));
  if (edit != nullptr) {
    auto edited = EditOnnxGraph(model, *edit, name);
    if (!edited.ok()) return absl::FailedPreconditionError(edited.status().message());
    model = *std::move(edited);
  }
  auto session = OnnxSession::Create(runtime, model, name, options);
  if (!absl::IsInvalidArgument(session.status())) return session;
  return absl::FailedPreconditionError(session.status().message());
}

absl::Status CheckShape(const OnnxTensor& tensor, const std::vector<int64_t>& shape,
                        const char* model) {
  if (tensor.shape == shape) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("SAM: ", model, ": not the expected model: an output has another shape"));
}

constexpr const char* kSamNames[] = {kSamEncoder, kSamDecoder, kOnnxLibrary};
constexpr InstalledFiles kSamFiles = {"SAM", "deploy/sam.sh", kSamNames};

}  // namespace

absl::Status CheckSamFiles(const std::filesystem::path& folder) {
  return CheckInstalledFiles(kSamFiles, folder);
}

absl::StatusOr<std::string> SamEncoderDigest(const std::filesystem::path& folder) {
  ASSIGN_OR_RETURN(auto digests, ReadInstalledDigests(kSamFiles, folder));
  return digests[kSamEncoder];
}

absl::StatusOr<std::unique_ptr<const SamNetworks>> SamNetworks::Open(
    const std::filesystem::path& folder, const OnnxGraphEdit& edit,
    const OnnxSessionOptions& options) {
  auto networks = std::make_unique<SamNetworks>();
  auto runtime = OnnxRuntime::Load(folder / kOnnxLibrary);
  if (!runtime.ok()) {
    return absl::Status(runtime.status().code(), absl::StrCat("SAM: ", runtime.status().message()));
  }
  networks->runtime = *std::move(runtime);
  ASSIGN_OR_RETURN(networks->encoder,
                   OpenSession(*networks->runtime, folder / kSamEncoder, options, nullptr));
  ASSIGN_OR_RETURN(networks->decoder,
                   OpenSession(*networks->runtime, folder / kSamDecoder, options, &edit));
  return networks;
}

void SamNetworks::Interrupt() const {
  encoder->Interrupt();
  decoder->Interrupt();
}

absl::StatusOr<OnnxTensor> EmbedPhotograph(const OnnxSession& encoder, const Image& photo) {
  const std::vector<float> planes = EncoderInput(photo);
  const OnnxInput input = {"input", {1, 3, kSamFrame, kSamFrame}, planes};
  constexpr std::array<const char*, 1> kOutputs = {"output"};
  ASSIGN_OR_RETURN(std::vector<OnnxTensor> outputs, encoder.Run({&input, 1}, kOutputs));
  RETURN_IF_ERROR(CheckShape(outputs[0], {1, 256, 64, 64}, kSamEncoder));
  return std::move(outputs[0]);
}

absl::StatusOr<std::vector<OnnxTensor>> RunSamDecoder(const OnnxSession& decoder,
                                                      std::span<const OnnxInput> inputs,
                                                      int64_t num_prompts) {
  constexpr int64_t kMasks = PromptAnswers::kMasks, kExtent = PromptAnswers::kExtent;
  constexpr std::array<const char*, 2> kOutputs = {kSamMasks, kSamIous};
  ASSIGN_OR_RETURN(std::vector<OnnxTensor> outputs, decoder.Run(inputs, kOutputs));
  RETURN_IF_ERROR(CheckShape(outputs[0], {num_prompts, kMasks, kExtent, kExtent}, kSamDecoder));
  RETURN_IF_ERROR(CheckShape(outputs[1], {num_prompts, kMasks}, kSamDecoder));
  return outputs;
}

}  // namespace pepeseg
