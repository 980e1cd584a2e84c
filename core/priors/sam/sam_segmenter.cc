#include "core/priors/sam/sam_segmenter.h"

#include <algorithm>
#include <array>
#include <map>
#include <opencv2/imgproc.hpp>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/priors/sam/onnx_graph.h"
#include "core/priors/sam/onnx_runtime.h"

namespace pepeseg {
namespace {

// Files of a folder that deploy/sam.sh has made.
constexpr char kSamEncoder[] = "encoder.onnx", kSamDecoder[] = "sam.onnx",
               kSamRuntime[] = "libonnxruntime.so.1", kSamDigests[] = "SHA256SUMS";
// CUDA provider of ONNX Runtime, which an operator may add to the folder. It has no digest.
constexpr char kSamCudaProvider[] = "libonnxruntime_providers_cuda.so";
constexpr int64_t kMaxDigestFile = 4096;  // bytes of SHA256SUMS

constexpr int64_t kMaxModelBytes = int64_t{1} << 30;
constexpr int kFrame = 1024;  // side of the encoder's square image, pixels
constexpr int kExtent = PromptAnswers::kExtent;
constexpr int kMasks = PromptAnswers::kMasks;
constexpr float kPadding = -1;  // label of a padding point

// Tensors of the decoder's graph: all four masks, and their estimated IoUs.
constexpr char kAllMasks[] = "/Reshape_9_output_0";
constexpr char kAllIous[] = "/iou_prediction_head/layers.2/Gemm_output_0";

// Returns the changes to the decoder's graph. As shipped, it takes one prompt a run and returns the
// best mask. Here all four masks and their IoUs become outputs, and the number of prompts becomes
// free. The image's tensors are no longer repeated for each prompt: broadcasting computes the image
// side of the first attention layer once a run, which is exact and was measured to save a fifth of
// the time. The branch for masks as prompts is dropped.
OnnxGraphEdit DecoderEdit() {
  OnnxGraphEdit edit;
  edit.rewired = {
      {"/Reshape_3_output_0", "image_embeddings"},       // embeddings, repeated
      {"/Reshape_6_output_0", "/Unsqueeze_1_output_0"},  // their positions, repeated
      {"/Gather_2_output_0", "/Gather_1_output_0"},      // batch size: the image's, the prompts'
      {"/Add_6_output_0", "onnx::Mul_1919"},             // embedding of the mask, and of none
  };
  edit.inputs = {{"image_embeddings", {1, 256, 64, 64}},
                 {"point_coords", {-1, -1, 2}},
                 {"point_labels", {-1, -1}}};
  edit.outputs = {{kAllMasks, {-1, kMasks, kExtent, kExtent}}, {kAllIous, {-1, kMasks}}};
  return edit;
}

// Returns the encoder's input, [3, kFrame, kFrame]: the photograph scaled so that its longer side
// fills the frame, normalised with the mean and standard deviation of SAM's training, with zeros to
// the right or below.
std::vector<float> EncoderInput(const Image& photo) {
  // RGB, of 255. Padding is 0 after normalising.
  constexpr std::array<float, 3> kMean = {123.675F, 116.28F, 103.53F};
  constexpr std::array<float, 3> kDeviation = {58.395F, 57.12F, 57.375F};
  const double scale = double{kFrame} / std::max(photo.width, photo.height);
  const cv::Mat from(photo.height, photo.width, CV_8UC3, const_cast<uint8_t*>(photo.pixels.data()));
  cv::Mat to;
  const cv::Size size(std::max(1, cvRound(photo.width * scale)),
                      std::max(1, cvRound(photo.height * scale)));
  // Area for shrinking; it would repeat pixels when enlarging.
  cv::resize(from, to, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
  std::vector<float> planes(size_t{3} * kFrame * kFrame, 0);
  for (int y = 0; y < to.rows; ++y) {
    const auto* row = to.ptr<cv::Vec3b>(y);
    for (int c = 0; c < 3; ++c) {
      float* out = &planes[(static_cast<size_t>(c) * kFrame + y) * kFrame];
      for (int x = 0; x < to.cols; ++x) out[x] = (row[x][c] - kMean[c]) / kDeviation[c];
    }
  }
  return planes;
}

// Returns FAILED_PRECONDITION with the file, the reason and the remedy.
absl::Status Bad(const std::filesystem::path& file, absl::string_view what) {
  return absl::FailedPreconditionError(
      absl::StrCat("SAM: ", file.string(), ": ", what, "; run deploy/sam.sh ",
                   file.parent_path().string(), " to install it again"));
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

// The encoder runs once a photograph and its embedding is kept; the decoder runs for each batch of
// prompts.
class SamSegmenter : public PromptedSegmenter {
 public:
  SamSegmenter(const OnnxSession& encoder, const OnnxSession& decoder)
      : encoder_(encoder), decoder_(decoder) {}

  absl::Status SetPhotograph(const Image& photo) override {
    grid_ = AnswerGrid(photo.width, photo.height);
    const std::vector<float> planes = EncoderInput(photo);
    const OnnxInput input = {"input", {1, 3, kFrame, kFrame}, planes};
    constexpr std::array<const char*, 1> kOutputs = {"output"};
    ASSIGN_OR_RETURN(std::vector<OnnxTensor> outputs, encoder_.Run({&input, 1}, kOutputs));
    embedding_ = std::move(outputs[0]);
    return CheckShape(embedding_, {1, 256, 64, 64}, kSamEncoder);
  }

  absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) override {
    const auto num_prompts = static_cast<int64_t>(prompts.size());
    // One tensor holds all prompts, so each of a call must have as many points as the first, and
    // one for padding.
    const auto num_points = static_cast<int64_t>(prompts[0].size()) + 1;
    std::vector<float> points, labels;
    for (const SegmenterPrompt& prompt : prompts) AppendPrompt(prompt, points, labels);
    const std::array<OnnxInput, 3> inputs = {
        OnnxInput{"image_embeddings", embedding_.shape, embedding_.values},
        OnnxInput{"point_coords", {num_prompts, num_points, 2}, points},
        OnnxInput{"point_labels", {num_prompts, num_points}, labels}};
    constexpr std::array<const char*, 2> kOutputs = {kAllMasks, kAllIous};
    ASSIGN_OR_RETURN(std::vector<OnnxTensor> outputs, decoder_.Run(inputs, kOutputs));
    RETURN_IF_ERROR(CheckShape(outputs[0], {num_prompts, kMasks, kExtent, kExtent}, kSamDecoder));
    RETURN_IF_ERROR(CheckShape(outputs[1], {num_prompts, kMasks}, kSamDecoder));
    PromptAnswers answers = grid_;
    answers.ious = std::move(outputs[1].values);
    answers.logits = WithoutPadding(outputs[0].values);
    return answers;
  }

 private:
  static absl::Status CheckShape(const OnnxTensor& tensor, const std::vector<int64_t>& shape,
                                 const char* model) {
    if (tensor.shape == shape) return absl::OkStatus();
    return absl::FailedPreconditionError(
        absl::StrCat("SAM: ", model, ": not the expected model: an output has another shape"));
  }

  // Appends a prompt in pixels of the frame, whose first pixel has its centre at 0. SAM expects a
  // padding point at the end of a prompt without a box.
  void AppendPrompt(const SegmenterPrompt& prompt, std::vector<float>& points,
                    std::vector<float>& labels) const {
    const double scale = grid_.cells_per_pixel * kFrame / kExtent;
    for (const PromptPoint& point : prompt) {
      points.push_back(static_cast<float>(point.x * scale - 0.5));
      points.push_back(static_cast<float>(point.y * scale - 0.5));
      labels.push_back(point.positive ? 1.0F : 0.0F);
    }
    points.insert(points.end(), {0, 0});
    labels.push_back(kPadding);
  }

  // Crops kExtent x kExtent masks to the grid: the rest shows the frame's padding.
  std::vector<float> WithoutPadding(std::span<const float> squares) const {
    std::vector<float> cells;
    cells.reserve(squares.size() / kExtent / kExtent * grid_.width * grid_.height);
    for (size_t first = 0; first < squares.size(); first += size_t{kExtent} * kExtent) {
      for (int y = 0; y < grid_.height; ++y) {
        const auto row = squares.subspan(first + static_cast<size_t>(y) * kExtent, grid_.width);
        cells.insert(cells.end(), row.begin(), row.end());
      }
    }
    return cells;
  }

  const OnnxSession& encoder_;
  const OnnxSession& decoder_;
  PromptAnswers grid_;    // grid of the photograph, without answers
  OnnxTensor embedding_;  // [1, 256, 64, 64], the photograph's
};

}  // namespace

// A missing SHA256SUMS means that SAM is not installed; everything else that is wrong means that
// the installation is damaged.
absl::Status CheckSamFiles(const std::filesystem::path& folder) {
  const std::filesystem::path list = folder / kSamDigests;
  const absl::StatusOr<std::string> text = ReadFile(list, list.string(), kMaxDigestFile);
  if (absl::IsNotFound(text.status())) {
    return absl::NotFoundError(absl::StrCat("SAM: ", list.string(),
                                            " does not exist; run deploy/sam.sh ", folder.string(),
                                            " to install SAM there"));
  }
  if (!text.ok()) return Bad(list, text.status().message());
  std::map<std::string, std::string> digests;
  for (const absl::string_view line : absl::StrSplit(*text, '\n', absl::SkipEmpty())) {
    const std::pair<std::string, std::string> words =
        // The format of sha256sum: the digest, two spaces, the name.
        absl::StrSplit(line, absl::MaxSplits("  ", 1));
    digests[words.second] = words.first;
  }
  for (const char* name : {kSamEncoder, kSamDecoder, kSamRuntime}) {
    const std::filesystem::path file = folder / name;
    if (!digests.contains(name)) return Bad(list, absl::StrCat("has no line for ", name));
    const absl::StatusOr<std::string> digest = Sha256OfFile(file);
    if (!digest.ok()) return Bad(file, digest.status().message());
    if (*digest == digests[name]) continue;
    return Bad(file, absl::StrCat("its SHA-256 is ", *digest, ", not ", digests[name],
                                  " as in SHA256SUMS"));
  }
  return absl::OkStatus();
}

struct SamModel::Networks {
  std::unique_ptr<OnnxRuntime> runtime;
  std::unique_ptr<OnnxSession> encoder, decoder;
  std::string processor = "the CPU";

  absl::Status OpenSessions(const std::filesystem::path& folder, const OnnxSessionOptions& options);
};

absl::Status SamModel::Networks::OpenSessions(const std::filesystem::path& folder,
                                              const OnnxSessionOptions& options) {
  ASSIGN_OR_RETURN(encoder, OpenSession(*runtime, folder / kSamEncoder, options, nullptr));
  const OnnxGraphEdit edit = DecoderEdit();
  ASSIGN_OR_RETURN(decoder, OpenSession(*runtime, folder / kSamDecoder, options, &edit));
  return absl::OkStatus();
}

SamModel::SamModel(std::unique_ptr<const Networks> networks) : networks_(std::move(networks)) {}
SamModel::~SamModel() = default;

absl::StatusOr<std::unique_ptr<SamModel>> SamModel::Open(const std::filesystem::path& folder,
                                                         const SamOptions& options) {
  RETURN_IF_ERROR(CheckSamFiles(folder));
  auto networks = std::make_unique<Networks>();
  auto runtime = OnnxRuntime::Load(folder / kSamRuntime);
  if (!runtime.ok()) {
    return absl::Status(runtime.status().code(), absl::StrCat("SAM: ", runtime.status().message()));
  }
  networks->runtime = *std::move(runtime);
  // A session computes on the thread that calls it and on per_session - 1 threads of its own, so
  // that photographs_at_once callers and the pool make num_threads.
  const int per_session = std::max(1, options.num_threads - options.photographs_at_once + 1);
  std::error_code ignored;
  if (options.cuda_device && std::filesystem::exists(folder / kSamCudaProvider, ignored)) {
    const absl::Status opened = networks->OpenSessions(folder, {per_session, *options.cuda_device});
    if (opened.ok()) {
      networks->processor = absl::StrCat("CUDA device ", *options.cuda_device);
      return std::unique_ptr<SamModel>(new SamModel(std::move(networks)));
    }
    networks->processor = absl::StrCat("the CPU, since CUDA failed: ", opened.message());
  }
  RETURN_IF_ERROR(networks->OpenSessions(folder, {per_session}));
  return std::unique_ptr<SamModel>(new SamModel(std::move(networks)));
}

const std::string& SamModel::processor() const { return networks_->processor; }

std::unique_ptr<PromptedSegmenter> SamModel::MakeSegmenter() const {
  return std::make_unique<SamSegmenter>(*networks_->encoder, *networks_->decoder);
}

void SamModel::Interrupt() const {
  networks_->encoder->Interrupt();
  networks_->decoder->Interrupt();
}

}  // namespace pepeseg
