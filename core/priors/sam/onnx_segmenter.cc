#include "core/priors/sam/onnx_segmenter.h"

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr int kExtent = PromptAnswers::kExtent;
constexpr int kMasks = PromptAnswers::kMasks;
constexpr float kPadding = -1;  // label of a padding point

class OnnxSegmenter : public PromptedSegmenter {
 public:
  explicit OnnxSegmenter(const SamNetworks& networks) : networks_(networks) {}

  absl::Status SetPhotograph(const Image& photo) override {
    grid_ = AnswerGrid(photo.width, photo.height);
    ASSIGN_OR_RETURN(embedding_, EmbedPhotograph(*networks_.encoder, photo));
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
    ASSIGN_OR_RETURN(std::vector<OnnxTensor> outputs,
                     RunSamDecoder(*networks_.decoder, inputs, num_prompts));
    PromptAnswers answers = grid_;
    answers.ious = std::move(outputs[1].values);
    answers.logits = WithoutPadding(outputs[0].values, kExtent, grid_);
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

  const SamNetworks& networks_;
  PromptAnswers grid_;    // grid of the photograph, without answers
  OnnxTensor embedding_;  // [1, 256, 64, 64], the photograph's
};

}  // namespace

OnnxGraphEdit PointDecoderEdit() {
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

std::unique_ptr<PromptedSegmenter> MakeOnnxSegmenter(const SamNetworks& networks) {
  return std::make_unique<OnnxSegmenter>(networks);
}

}  // namespace pepeseg
