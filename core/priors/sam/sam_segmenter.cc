#include "core/priors/sam/sam_segmenter.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/priors/sam/onnx_graph.h"
#include "core/priors/sam/onnx_runtime.h"
#include "core/priors/sam/sam_networks.h"

namespace pepeseg {
namespace {

constexpr int kExtent = PromptAnswers::kExtent;
constexpr int kMasks = PromptAnswers::kMasks;
constexpr float kPadding = -1;  // label of a padding point

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
  edit.outputs = {{kSamMasks, {-1, kMasks, kExtent, kExtent}}, {kSamIous, {-1, kMasks}}};
  return edit;
}

// The encoder runs once a photograph and its embedding is kept; the decoder runs for each batch of
// prompts.
class SamSegmenter : public PromptedSegmenter {
 public:
  SamSegmenter(const OnnxSession& encoder, const OnnxSession& decoder)
      : encoder_(encoder), decoder_(decoder) {}

  absl::Status SetPhotograph(const Image& photo) override {
    grid_ = AnswerGrid(photo.width, photo.height);
    ASSIGN_OR_RETURN(embedding_, EmbedPhotograph(encoder_, photo));
    return absl::OkStatus();
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
    ASSIGN_OR_RETURN(std::vector<OnnxTensor> outputs, RunSamDecoder(decoder_, inputs, num_prompts));
    PromptAnswers answers = grid_;
    answers.ious = std::move(outputs[1].values);
    answers.logits = WithoutPadding(outputs[0].values);
    return answers;
  }

 private:
  // Appends a prompt in pixels of the frame, whose first pixel has its centre at 0. SAM expects a
  // padding point at the end of a prompt without a box.
  void AppendPrompt(const SegmenterPrompt& prompt, std::vector<float>& points,
                    std::vector<float>& labels) const {
    const double scale = grid_.cells_per_pixel * kSamFrame / kExtent;
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

SamModel::SamModel(std::unique_ptr<const SamNetworks> networks) : networks_(std::move(networks)) {}
SamModel::~SamModel() = default;

absl::StatusOr<std::unique_ptr<SamModel>> SamModel::Open(const std::filesystem::path& folder,
                                                         const SamOptions& options) {
  // A session computes on the thread that calls it and on per_session - 1 threads of its own, so
  // that photographs_at_once callers and the pool make num_threads.
  const int per_session = std::max(1, options.num_threads - options.photographs_at_once + 1);
  ASSIGN_OR_RETURN(auto networks,
                   SamNetworks::Open(folder, DecoderEdit(), {per_session, options.cuda_device}));
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
