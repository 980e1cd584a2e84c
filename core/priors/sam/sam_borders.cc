#include "core/priors/sam/sam_borders.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/priors/sam/grid_mask.h"
#include "core/priors/sam/onnx_graph.h"
#include "core/priors/sam/prompted_segmenter.h"
#include "core/priors/sam/sam_networks.h"

namespace pepeseg {
namespace {

constexpr int kSide = PromptAnswers::kExtent;  // of the decoder's masks, cells
// Labels of points: inside the mask, and the two corners of a box.
constexpr float kInside = 1, kFirstCorner = 2, kLastCorner = 3;
constexpr int kMostPoints = 3;  // inside the mask, the deepest ones
// The prompt's logits: this much for each cell of distance from the border, up to the limit.
constexpr float kLogitOfCell = 4, kMostLogit = 10;
constexpr double kReach = 0.02;     // from the border, in diagonals of the image
constexpr double kSameThing = 0.7;  // least IoU of SAM's answer with the mask

// Returns the changes to the decoder's graph: all four masks and their IoUs become outputs. The
// inputs are those for one prompt of points and a mask.
OnnxGraphEdit MaskDecoderEdit() {
  OnnxGraphEdit edit;
  edit.inputs = {{"image_embeddings", {1, 256, 64, 64}},
                 {"point_coords", {1, -1, 2}},
                 {"point_labels", {1, -1}},
                 {"mask_input", {1, 1, kSide, kSide}},
                 {"has_mask_input", {1}}};
  edit.outputs = {{kSamMasks, {-1, PromptAnswers::kMasks, kSide, kSide}},
                  {kSamIous, {-1, PromptAnswers::kMasks}}};
  return edit;
}

// Returns the distance of each pixel's centre from the nearest pixel on the other side of the
// mask's border, pixels: positive inside.
cv::Mat SignedDistance(const cv::Mat& mask) {
  cv::Mat inside, outside;
  cv::distanceTransform(mask, inside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  cv::distanceTransform(1 - mask, outside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  return inside - outside;
}

struct SamPrompt {
  std::vector<float> points;  // [num, 2], pixels of SAM's frame, whose first has its centre at 0
  std::vector<float> labels;  // [num]
  std::vector<float> logits;  // [kSide, kSide]

  void AddPoint(double x, double y, float label) {
    points.push_back(static_cast<float>(x));
    points.push_back(static_cast<float>(y));
    labels.push_back(label);
  }
};

// Returns the prompt for a mask: its deepest points, its box and the mask itself.
SamPrompt PromptOf(const cv::Mat& mask, const cv::Mat& distance, const PromptAnswers& grid) {
  SamPrompt prompt;
  const double scale = grid.cells_per_pixel * kSamFrame / kSide;
  for (const cv::Point& point : DeepestCells(mask, kMostPoints)) {
    prompt.AddPoint((point.x + 0.5) * scale - 0.5, (point.y + 0.5) * scale - 0.5, kInside);
  }
  const cv::Rect box = cv::boundingRect(mask);
  prompt.AddPoint(box.x * scale - 0.5, box.y * scale - 0.5, kFirstCorner);
  prompt.AddPoint(box.br().x * scale - 0.5, box.br().y * scale - 0.5, kLastCorner);

  cv::Mat cells;
  cv::resize(distance, cells, cv::Size(grid.width, grid.height), 0, 0, cv::INTER_AREA);
  // Cells to the right of the image and below it are outside the mask.
  prompt.logits.assign(size_t{kSide} * kSide, -kMostLogit);
  const auto logit_of_pixel = static_cast<float>(kLogitOfCell * grid.cells_per_pixel);
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      prompt.logits[static_cast<size_t>(y) * kSide + x] =
          std::clamp(logit_of_pixel * cells.at<float>(y, x), -kMostLogit, kMostLogit);
    }
  }
  return prompt;
}

double IouOf(const cv::Mat& a, const cv::Mat& b) {
  const int common = cv::countNonZero(a & b), united = cv::countNonZero(a | b);
  return united == 0 ? 0 : static_cast<double>(common) / united;
}

}  // namespace

SamBorders::SamBorders(std::unique_ptr<const SamNetworks> networks)
    : networks_(std::move(networks)) {}
SamBorders::~SamBorders() = default;

absl::StatusOr<std::unique_ptr<SamBorders>> SamBorders::Open(const std::filesystem::path& folder,
                                                             int num_threads) {
  RETURN_IF_ERROR(CheckSamFiles(folder));
  ASSIGN_OR_RETURN(auto networks, SamNetworks::Open(folder, MaskDecoderEdit(), {num_threads}));
  return std::unique_ptr<SamBorders>(new SamBorders(std::move(networks)));
}

absl::StatusOr<OnnxTensor> SamBorders::Embed(const Image& image) const {
  return EmbedPhotograph(*networks_->encoder, image);
}

// The first of the decoder's four masks is the one for prompts that leave no doubt which thing is
// meant (Kirillov et al. 2023, "Segment Anything").
absl::StatusOr<BinaryMask> SamBorders::Refine(const OnnxTensor& embedding, const BinaryMask& mask,
                                              int width, int height) const {
  const cv::Mat before(height, width, CV_8U, const_cast<uint8_t*>(mask.pixels.data()));
  const int area = cv::countNonZero(before);
  if (area == 0 || area == width * height) return mask;  // no border
  const PromptAnswers grid = AnswerGrid(width, height);
  const cv::Mat distance = SignedDistance(before);
  const SamPrompt prompt = PromptOf(before, distance, grid);
  const auto num_points = static_cast<int64_t>(prompt.labels.size());
  const std::array<float, 1> has_mask = {1};
  const std::array<OnnxInput, 5> inputs = {
      OnnxInput{"image_embeddings", embedding.shape, embedding.values},
      OnnxInput{"point_coords", {1, num_points, 2}, prompt.points},
      OnnxInput{"point_labels", {1, num_points}, prompt.labels},
      OnnxInput{"mask_input", {1, 1, kSide, kSide}, prompt.logits},
      OnnxInput{"has_mask_input", {1}, has_mask}};
  ASSIGN_OR_RETURN(std::vector<OnnxTensor> outputs, RunSamDecoder(*networks_->decoder, inputs, 1));
  const cv::Mat first(kSide, kSide, CV_32F, outputs[0].values.data());
  // The rest of the square shows the padding.
  const cv::Mat cells = first(cv::Rect(0, 0, grid.width, grid.height));
  const cv::Mat seen = PixelsInside(cells, grid.cells_per_pixel, before.size()) / 255;
  if (IouOf(seen, before) < kSameThing) return mask;
  BinaryMask refined = mask;
  cv::Mat after(height, width, CV_8U, refined.pixels.data());
  seen.copyTo(after, cv::abs(distance) <= kReach * std::hypot(width, height));
  return refined;
}

}  // namespace pepeseg
