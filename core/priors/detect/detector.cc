#include "core/priors/detect/detector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/onnx/installed_files.h"

namespace pepeseg {
namespace {

constexpr const char* kNames[] = {kDetectorNetwork, kDetectorWords, kOnnxLibrary};
constexpr InstalledFiles kDetectorFiles = {"detector", "deploy/detector.sh", kNames};
constexpr int64_t kMaxNetworkBytes = int64_t{1} << 30, kMaxWordsBytes = int64_t{1} << 20;

// The network's input is [1, kFrame, kFrame, 3], RGB in [0, 255]. Its outputs are, on a grid of
// kCells x kCells, the score of each word that a thing has its centre in the cell, and the
// distances of the box's sides from the cell's first corner: left, top, right, bottom.
constexpr int kFrame = 512, kCells = 128, kSides = 4;
constexpr int kStride = kFrame / kCells;
constexpr double kTileSide = 0.6;    // of two tiles along a side, of the photograph's
constexpr float kSameThing = 0.5F;   // IoU of boxes of one word that are one thing
constexpr float kCutMargin = 0.02F;  // of a tile's side: closer to it a box is cut off

absl::Status NotExpected(const std::string& what) {
  return absl::FailedPreconditionError(
      absl::StrCat("detector: not the expected network: ", what,
                   "; run deploy/detector.sh to install it again"));
}

// Where a window is in the frame: scaled so that its longer side fills the frame, in the middle.
struct Letterbox {
  Letterbox(int width, int height)
      : scale(static_cast<float>(kFrame) / static_cast<float>(std::max(width, height))),
        size(std::max(1, cvRound(width * scale)), std::max(1, cvRound(height * scale))),
        x((kFrame - size.width) / 2),
        y((kFrame - size.height) / 2) {}
  float scale;  // pixels of the frame per pixel of the window
  cv::Size size;
  int x, y;
};

// Black around the photograph: fruit_table's apple is found 1.2 times as well as in a stretched
// photograph, and as well as on grey (tests/bench/results/words.md).
std::vector<float> FrameOf(const cv::Mat& from, const Letterbox& box) {
  cv::Mat to;
  cv::resize(from, to, box.size, 0, 0, box.scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
  std::vector<float> frame(size_t{kFrame} * kFrame * 3, 0);
  for (int y = 0; y < to.rows; ++y) {
    const uint8_t* row = to.ptr<uint8_t>(y);
    std::copy_n(row, size_t{3} * to.cols, &frame[(size_t{kFrame} * (y + box.y) + box.x) * 3]);
  }
  return frame;
}

// Calls `use` with cell, word and score where the score is at least the lowest one and none of the
// neighbours' is higher.
template <typename Use>
void ForPeaks(const std::vector<float>& scores, int num_words, Use use) {
  const auto at = [&](int x, int y, int word) {
    return scores[(size_t{kCells} * y + x) * num_words + word];
  };
  for (int y = 0; y < kCells; ++y) {
    for (int x = 0; x < kCells; ++x) {
      for (int word = 0; word < num_words; ++word) {
        const float score = at(x, y, word);
        if (!(score >= Detector::kMinScore)) continue;
        bool highest = true;
        for (int v = std::max(0, y - 1); v <= std::min(kCells - 1, y + 1); ++v) {
          for (int u = std::max(0, x - 1); u <= std::min(kCells - 1, x + 1); ++u) {
            highest = highest && at(u, v, word) <= score;
          }
        }
        if (highest) use(x, y, word, score);
      }
    }
  }
}

float Area(const DetectedBox& box) { return (box.x1 - box.x0) * (box.y1 - box.y0); }

float BoxIou(const DetectedBox& a, const DetectedBox& b) {
  const float width = std::min(a.x1, b.x1) - std::max(a.x0, b.x0);
  const float height = std::min(a.y1, b.y1) - std::max(a.y0, b.y0);
  if (width <= 0 || height <= 0) return 0;
  return width * height / (Area(a) + Area(b) - width * height);
}

// Keeps the best box of each thing, at most kMaxBoxes, best first.
std::vector<DetectedBox> BestOf(std::vector<DetectedBox> boxes) {
  std::stable_sort(boxes.begin(), boxes.end(),
                   [](const DetectedBox& a, const DetectedBox& b) { return a.score > b.score; });
  std::vector<DetectedBox> best;
  for (const DetectedBox& box : boxes) {
    const bool again = std::any_of(best.begin(), best.end(), [&](const DetectedBox& kept) {
      return kept.word == box.word && BoxIou(kept, box) > kSameThing;
    });
    if (!again) best.push_back(box);
    if (best.size() == Detector::kMaxBoxes) break;
  }
  return best;
}

}  // namespace

absl::StatusOr<std::vector<std::string>> ReadDetectorWords(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / kDetectorWords;
  ASSIGN_OR_RETURN(const std::string text, ReadFile(file, file.string(), kMaxWordsBytes));
  std::vector<std::string> words;
  for (const absl::string_view line : absl::StrSplit(text, '\n', absl::SkipEmpty())) {
    words.push_back(absl::AsciiStrToLower(absl::StripAsciiWhitespace(line)));
  }
  const std::set<std::string> once(words.begin(), words.end());
  if (words.empty() || words.size() > Detector::kMaxWords || once.size() != words.size() ||
      once.contains("")) {
    return absl::FailedPreconditionError(absl::StrCat("detector: ", file.string(),
                                                      ": does not have 1 to ", Detector::kMaxWords,
                                                      " different words, one a line"));
  }
  return words;
}

absl::Status CheckDetectorFiles(const std::filesystem::path& folder) {
  return CheckInstalledFiles(kDetectorFiles, folder);
}

absl::StatusOr<std::unique_ptr<Detector>> Detector::Load(const std::filesystem::path& folder,
                                                         const DetectorOptions& options) {
  RETURN_IF_ERROR(CheckDetectorFiles(folder));
  std::unique_ptr<Detector> detector(new Detector());
  detector->options_ = options;
  ASSIGN_OR_RETURN(detector->words_, ReadDetectorWords(folder));
  auto runtime = OnnxRuntime::Load(folder / kOnnxLibrary);
  if (!runtime.ok()) {
    return absl::Status(runtime.status().code(),
                        absl::StrCat("detector: ", runtime.status().message()));
  }
  detector->runtime_ = *std::move(runtime);
  const std::string name = absl::StrCat("detector: ", (folder / kDetectorNetwork).string());
  ASSIGN_OR_RETURN(const std::string network,
                   ReadFile(folder / kDetectorNetwork, name, kMaxNetworkBytes));
  auto session = OnnxSession::Create(*detector->runtime_, network, name, {options.num_threads});
  if (absl::IsInvalidArgument(session.status())) {
    return absl::FailedPreconditionError(session.status().message());
  }
  RETURN_IF_ERROR(session.status());
  detector->session_ = *std::move(session);
  return detector;
}

// Returns the whole photograph first. Tiles overlap, so that a thing that one cuts is whole in the
// next.
std::vector<Detector::Window> Detector::WindowsOf(const Image& photo) const {
  std::vector<Window> windows = {{0, 0, photo.width, photo.height}};
  const int tiles = options_.tiles;
  if (tiles < 2) return windows;
  const double side = std::min(1.0, kTileSide * 2 / tiles);
  const int width = std::max(1, static_cast<int>(std::ceil(photo.width * side)));
  const int height = std::max(1, static_cast<int>(std::ceil(photo.height * side)));
  for (int row = 0; row < tiles; ++row) {
    for (int column = 0; column < tiles; ++column) {
      windows.push_back({(photo.width - width) * column / (tiles - 1),
                         (photo.height - height) * row / (tiles - 1), width, height});
    }
  }
  return windows;
}

absl::Status Detector::Look(const Image& photo, const Window& window,
                            std::vector<DetectedBox>& found) const {
  const cv::Mat whole(photo.height, photo.width, CV_8UC3,
                      const_cast<uint8_t*>(photo.pixels.data()));
  const Letterbox letterbox(window.width, window.height);
  const std::vector<float> frame =
      FrameOf(whole(cv::Rect(window.x, window.y, window.width, window.height)), letterbox);
  const std::array<OnnxInput, 1> inputs = {OnnxInput{"images", {1, kFrame, kFrame, 3}, frame}};
  constexpr std::array<const char*, 2> kOutputs = {"scores", "sides"};
  auto outputs = session_->Run(inputs, kOutputs);
  if (absl::IsInvalidArgument(outputs.status())) {
    return NotExpected(std::string(outputs.status().message()));
  }
  RETURN_IF_ERROR(outputs.status());
  const auto num_words = static_cast<int64_t>(words_.size());
  if ((*outputs)[0].shape != std::vector<int64_t>{1, kCells, kCells, num_words} ||
      (*outputs)[1].shape != std::vector<int64_t>{1, kCells, kCells, kSides}) {
    return NotExpected("an output has another shape");
  }
  const auto width = static_cast<float>(photo.width), height = static_cast<float>(photo.height);
  // A box that ends at the side of a tile, but not of the photograph, is cut off there.
  const auto cut = [](float first, float last, float window_first, float window_last, float end) {
    const float margin = kCutMargin * (window_last - window_first);
    return (window_first > 0 && first < window_first + margin) ||
           (window_last < end && last > window_last - margin);
  };
  ForPeaks(
      (*outputs)[0].values, static_cast<int>(num_words), [&](int x, int y, int word, float score) {
        const float* sides = &(*outputs)[1].values[(size_t{kCells} * y + x) * kSides];
        const auto photo_x = [&](float u) {
          return std::clamp(static_cast<float>(window.x) +
                                (u - static_cast<float>(letterbox.x)) / letterbox.scale,
                            0.0F, width);
        };
        const auto photo_y = [&](float v) {
          return std::clamp(static_cast<float>(window.y) +
                                (v - static_cast<float>(letterbox.y)) / letterbox.scale,
                            0.0F, height);
        };
        const auto left = static_cast<float>(x * kStride), top = static_cast<float>(y * kStride);
        const DetectedBox box = {word,
                                 score,
                                 photo_x(left - sides[0]),
                                 photo_y(top - sides[1]),
                                 photo_x(left + sides[2]),
                                 photo_y(top + sides[3])};
        if (!(box.x1 > box.x0 && box.y1 > box.y0)) return;
        const auto first_x = static_cast<float>(window.x), first_y = static_cast<float>(window.y);
        if (cut(box.x0, box.x1, first_x, first_x + static_cast<float>(window.width), width) ||
            cut(box.y0, box.y1, first_y, first_y + static_cast<float>(window.height), height)) {
          return;
        }
        found.push_back(box);
      });
  return absl::OkStatus();
}

absl::StatusOr<std::vector<DetectedBox>> Detector::Detect(const Image& photo) const {
  std::vector<DetectedBox> found;
  for (const Window& window : WindowsOf(photo)) RETURN_IF_ERROR(Look(photo, window, found));
  return BestOf(std::move(found));
}

}  // namespace pepeseg
