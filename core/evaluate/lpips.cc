#include "core/evaluate/lpips.h"

#include <cmath>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "opencv2/dnn.hpp"

namespace pepeseg {
namespace {

constexpr int64_t kMaxWeightsBytes = int64_t{1} << 30;

// Returns interleaved values as planes [1, 3, height, width] in [-1, 1]. Multiplying by `scale`
// brings the values to [0, 1].
template <class T>
cv::Mat Blob(int width, int height, std::span<const T> pixels, float scale) {
  const int sizes[] = {1, 3, height, width};
  cv::Mat blob(4, sizes, CV_32F);
  const size_t num_pixels = static_cast<size_t>(width) * height;
  auto* planes = blob.ptr<float>();
  for (size_t i = 0; i < 3 * num_pixels; ++i) {
    planes[i % 3 * num_pixels + i / 3] = 2 * scale * static_cast<float>(pixels[i]) - 1;
  }
  return blob;
}

// Returns the reason alone: OpenCV's full message has a line break and a source location before it.
std::string ReasonOf(const cv::Exception& error) {
  return error.err.empty() ? error.what() : error.err;
}

}  // namespace

struct Lpips::Network {
  cv::dnn::Net net;
};

Lpips::Lpips(std::unique_ptr<Network> network) : network_(std::move(network)) {}
Lpips::Lpips(Lpips&& other) noexcept = default;
Lpips& Lpips::operator=(Lpips&& other) noexcept = default;
Lpips::~Lpips() = default;

absl::StatusOr<Lpips> Lpips::Open(const std::filesystem::path& weights) {
  const std::string name = weights.string();
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(weights, name, kMaxWeightsBytes));
  auto network = std::make_unique<Network>();
  try {
    network->net = cv::dnn::readNetFromONNX(bytes.data(), bytes.size());
  } catch (const cv::Exception& error) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": not an ONNX network that OpenCV reads: ", ReasonOf(error)));
  }
  Lpips lpips(std::move(network));
  constexpr int kProbeSize = 64;
  const Image black{kProbeSize, kProbeSize, 3,
                    std::vector<uint8_t>(3 * kProbeSize * kProbeSize, 0)};
  std::vector<float> rendering(black.pixels.size(), 0.0f);
  const absl::StatusOr<double> equal = lpips.Distance(black, rendering);
  for (size_t i = 0; i < rendering.size(); i += 2) rendering[i] = 1;
  const absl::StatusOr<double> different = lpips.Distance(black, rendering);
  for (const auto& distance : {equal, different}) {
    if (distance.ok()) continue;
    return absl::InvalidArgumentError(absl::StrCat(name, ": ", distance.status().message()));
  }
  if (!(std::abs(*equal) < 1e-4 && *different > 1e-4)) {
    return absl::InvalidArgumentError(absl::StrCat(
        name, ": no distance: ", *equal, " of equal images, ", *different, " of different ones"));
  }
  return lpips;
}

absl::StatusOr<double> Lpips::Distance(const Image& photo, std::span<const float> rendering) {
  std::vector<cv::Mat> maps;
  try {
    cv::dnn::Net& net = network_->net;
    net.setInput(Blob<uint8_t>(photo.width, photo.height, photo.pixels, 1.0f / 255), "photo");
    net.setInput(Blob<float>(photo.width, photo.height, rendering, 1.0f), "rendering");
    net.forward(maps, net.getUnconnectedOutLayersNames());
  } catch (const cv::Exception& error) {
    return absl::InternalError(absl::StrCat("the network fails on images of ", photo.width, "x",
                                            photo.height, ": ", ReasonOf(error)));
  }
  double distance = 0;
  for (const cv::Mat& map : maps) {
    if (map.type() != CV_32F || map.empty()) return absl::InternalError("an output has no floats");
    distance += std::accumulate(map.begin<float>(), map.end<float>(), 0.0) /
                static_cast<double>(map.total());
  }
  if (!std::isfinite(distance)) return absl::InternalError("the network's answer is not finite");
  return distance;
}

absl::StatusOr<HeldOutScorer> HeldOutScorer::Create(const std::filesystem::path& lpips_weights) {
  HeldOutScorer scorer;
  if (lpips_weights.empty()) return scorer;
  ASSIGN_OR_RETURN(scorer.lpips_, Lpips::Open(lpips_weights));
  return scorer;
}

// If LPIPS fails, the training goes on, and the view has only PSNR and SSIM.
absl::StatusOr<std::vector<ViewScores>> HeldOutScorer::Score(
    Backend& backend, const Capture& capture, const Gaussians& gaussians,
    absl::FunctionRef<void(const std::string&)> warn) {
  if (!lpips_) return ScoreHeldOut(backend, capture, gaussians);
  bool warned = false;  // one reason is enough for all views
  const auto distance = [&](const Image& photo,
                            std::span<const float> rendering) -> std::optional<double> {
    const absl::StatusOr<double> lpips = lpips_->Distance(photo, rendering);
    if (lpips.ok()) return *lpips;
    if (!warned) warn(absl::StrCat("no LPIPS: ", lpips.status().message()));
    warned = true;
    return std::nullopt;
  };
  return ScoreHeldOut(backend, capture, gaussians, distance);
}

}  // namespace pepeseg
