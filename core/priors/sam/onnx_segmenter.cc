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
// Labels of points: padding, and the two corners of a box.
constexpr float kPadding = -1, kFirstCorner = 2, kLastCorner = 3;
constexpr int64_t kChannels = 256, kPlaces = 4096;  // of an embedding

class OnnxSegmenter : public PromptedSegmenter {
 public:
  OnnxSegmenter(const SamNetworks& networks, bool mask_prompts)
      : networks_(networks), mask_prompts_(mask_prompts) {}

  absl::Status SetPhotograph(const Image& photo) override {
    SetSize(photo.width, photo.height);
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
    if (mask_prompts_) {
      if (num_prompts > 1) return absl::UnimplementedError("SAM: answers one prompt at a time");
      return AnswerOne(points, labels, std::vector<float>(size_t{kExtent} * kExtent), 0);
    }
    const std::array<OnnxInput, 3> inputs = {
        OnnxInput{"image_embeddings", embedding_.shape, embedding_.values},
        OnnxInput{"point_coords", {num_prompts, num_points, 2}, points},
        OnnxInput{"point_labels", {num_prompts, num_points}, labels}};
    return Answers(inputs, num_prompts);
  }

  // The network's channels are planes, those of an embedding rows.
  absl::StatusOr<SamEmbedding> Embedding() override {
    SamEmbedding embedding = {width_, height_, std::vector<Half>(embedding_.values.size())};
    for (int64_t i = 0; i < kPlaces * kChannels; ++i) {
      embedding.values[i] =
          HalfFromFloat(embedding_.values[i % kChannels * kPlaces + i / kChannels]);
    }
    return embedding;
  }

  absl::Status SetEmbedding(const SamEmbedding& embedding) override {
    if (std::cmp_not_equal(embedding.values.size(), kPlaces * kChannels)) {
      return absl::InvalidArgumentError("SAM: an embedding has another size");
    }
    SetSize(embedding.width, embedding.height);
    embedding_.shape = {1, kChannels, 64, 64};
    embedding_.values.resize(embedding.values.size());
    for (int64_t i = 0; i < kPlaces * kChannels; ++i) {
      embedding_.values[i % kChannels * kPlaces + i / kChannels] =
          FloatFromHalf(embedding.values[i]);
    }
    return absl::OkStatus();
  }

  absl::StatusOr<PromptAnswers> SegmentByMask(const MaskPrompt& prompt) override {
    std::vector<float> points, labels;
    AppendPrompt(prompt.points, points, labels);
    if (prompt.box) {
      points.resize(points.size() - 2);  // in place of the padding
      labels.pop_back();
      AppendPoint((*prompt.box)[0], kFirstCorner, points, labels);
      AppendPoint((*prompt.box)[1], kLastCorner, points, labels);
    }
    if (!prompt.logits.empty()) return AnswerOne(points, labels, prompt.logits, 1);
    return AnswerOne(points, labels, std::vector<float>(size_t{kExtent} * kExtent), 0);
  }

 private:
  // Answers one prompt with a mask (has_mask 1) or without one (0), by the network for both.
  absl::StatusOr<PromptAnswers> AnswerOne(std::span<const float> points,
                                          std::span<const float> labels,
                                          std::span<const float> mask, float has_mask) const {
    const auto num_points = static_cast<int64_t>(labels.size());
    const std::array<OnnxInput, 5> inputs = {
        OnnxInput{"image_embeddings", embedding_.shape, embedding_.values},
        OnnxInput{"point_coords", {1, num_points, 2}, points},
        OnnxInput{"point_labels", {1, num_points}, labels},
        OnnxInput{"mask_input", {1, 1, kExtent, kExtent}, mask},
        OnnxInput{"has_mask_input", {1}, {&has_mask, 1}}};
    return Answers(inputs, 1);
  }

  void SetSize(int width, int height) {
    width_ = width;
    height_ = height;
    grid_ = AnswerGrid(width, height);
  }

  // Appends a point in pixels of the frame, whose first pixel has its centre at 0.
  void AppendPoint(const PromptPoint& point, float label, std::vector<float>& points,
                   std::vector<float>& labels) const {
    const double scale = grid_.cells_per_pixel * kSamFrame / kExtent;
    points.push_back(static_cast<float>(point.x * scale - 0.5));
    points.push_back(static_cast<float>(point.y * scale - 0.5));
    labels.push_back(label);
  }

  // SAM expects a padding point at the end of a prompt without a box.
  void AppendPrompt(const SegmenterPrompt& prompt, std::vector<float>& points,
                    std::vector<float>& labels) const {
    for (const PromptPoint& point : prompt) {
      AppendPoint(point, point.positive ? 1 : 0, points, labels);
    }
    points.insert(points.end(), {0, 0});
    labels.push_back(kPadding);
  }

  absl::StatusOr<PromptAnswers> Answers(std::span<const OnnxInput> inputs,
                                        int64_t num_prompts) const {
    ASSIGN_OR_RETURN(std::vector<OnnxTensor> outputs,
                     RunSamDecoder(*networks_.decoder, inputs, num_prompts));
    PromptAnswers answers = grid_;
    answers.ious = std::move(outputs[1].values);
    answers.logits = WithoutPadding(outputs[0].values, kExtent, grid_);
    return answers;
  }

  const SamNetworks& networks_;
  const bool mask_prompts_;
  int width_ = 0, height_ = 0;  // of the photograph, pixels
  PromptAnswers grid_;          // grid of the photograph, without answers
  OnnxTensor embedding_;        // [1, 256, 64, 64], the photograph's
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

OnnxGraphEdit MaskDecoderEdit() {
  OnnxGraphEdit edit;
  edit.inputs = {{"image_embeddings", {1, 256, 64, 64}},
                 {"point_coords", {1, -1, 2}},
                 {"point_labels", {1, -1}},
                 {"mask_input", {1, 1, kExtent, kExtent}},
                 {"has_mask_input", {1}}};
  edit.outputs = {{kSamMasks, {-1, kMasks, kExtent, kExtent}}, {kSamIous, {-1, kMasks}}};
  return edit;
}

std::unique_ptr<PromptedSegmenter> MakeOnnxSegmenter(const SamNetworks& networks,
                                                     bool mask_prompts) {
  return std::make_unique<OnnxSegmenter>(networks, mask_prompts);
}

}  // namespace pepeseg
