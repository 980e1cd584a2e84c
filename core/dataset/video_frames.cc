#include "core/dataset/video_frames.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/module.h"
#include "core/base/status_macros.h"
#include "core/dataset/video_decoder.h"
#include "core/dataset/video_track.h"
#include "core/formats/images.h"
#include "opencv2/core.hpp"
#include "opencv2/imgproc.hpp"

namespace pepeseg {
namespace {

constexpr int kJpegQuality = 95;
constexpr int kLeastFrames = 3;
// Longer side, in pixels, of the reduced pictures in which sharpness and change are measured.
constexpr int kSharpnessSide = 640;
constexpr int kChangeSide = 64;
// Minimum mean difference of two reduced grey pictures, in grey levels of 0 to 255, for the camera
// to have moved. Measured: 0.1 to 0.5 for a camera on a table (noise and codec), at least 4 within
// half a second for a camera that is carried.
constexpr double kLeastChange = 1.5;
// Number of frames of a window whose sharpness is measured. Neighbouring frames are about equally
// sharp, so more would only cost time.
constexpr int64_t kCandidates = 8;
constexpr int64_t kFramesPerCall = 8;  // frames between two calls of the progress function

bool HasTag(std::span<const uint8_t> bytes, size_t at, absl::string_view tag) {
  return bytes.size() >= at + tag.size() &&
         std::equal(tag.begin(), tag.end(), bytes.begin() + static_cast<ptrdiff_t>(at),
                    [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; });
}

// Returns the frame in grey, shrunk so that its longer side is at most `side` pixels.
cv::Mat SmallGrey(const cv::Mat& frame, int side) {
  cv::Mat grey, small;
  cv::cvtColor(frame, grey, cv::COLOR_BGR2GRAY);
  const double scale = std::min(1.0, static_cast<double>(side) / std::max(frame.cols, frame.rows));
  cv::resize(grey, small, cv::Size(), scale, scale, cv::INTER_AREA);
  return small;
}

// Returns the variance of the Laplacian, which falls with motion blur and defocus.
double Sharpness(const cv::Mat& frame) {
  cv::Mat edges, mean, deviation;
  cv::Laplacian(SmallGrey(frame, kSharpnessSide), edges, CV_32F);
  cv::meanStdDev(edges, mean, deviation);
  return deviation.at<double>(0) * deviation.at<double>(0);
}

// Reads a video from its first frame on. Turns OpenCV's exceptions into errors.
class Reader {
 public:
  explicit Reader(const VideoTask& task) : task_(task) {}

  absl::Status Open() {
    // FFmpeg would also open URLs, devices, patterns of image names and playlists. Only the
    // absolute path of a regular file that begins like a video may reach it.
    std::error_code error;
    const std::filesystem::path path = std::filesystem::canonical(task_.path, error);
    if (error || !std::filesystem::is_regular_file(path, error)) {
      return Refused(task_.name, "is not a regular file");
    }
    std::array<char, 16> start{};
    std::ifstream file(path, std::ios::binary);
    file.read(start.data(), start.size());
    if (!file.is_open() || file.bad()) {
      return absl::InternalError(absl::StrCat(task_.name, ": cannot be read"));
    }
    if (!IsVideo({reinterpret_cast<const uint8_t*>(start.data()), start.size()})) {
      return Refused(task_.name, "is not an MP4, MOV, WebM, MKV or AVI video by its first bytes");
    }
    track_ = ReadVideoTrack(path);
    return OpenDecoder(path.string());
  }

  // Moves to the next frame without decoding it. Returns false at the end.
  absl::StatusOr<bool> Skip() {
    const bool read = video_->Next();
    if (read && ++num_read_ > kMaxVideoFrames) return TooLong();
    return read;
  }

  // Returns the picture that Skip moved to, as stored. It is valid until the next call.
  absl::StatusOr<cv::Mat> Picture() {
    if (!video_->Picture(bgr_)) {
      return Refused(task_.name, absl::StrCat("frame ", num_read_ - 1, " does not decode"));
    }
    return cv::Mat(video_->height(), video_->width(), CV_8UC3, bgr_.data());
  }

  // Returns a decoded frame upright and in its right colours.
  cv::Mat Shown(const cv::Mat& picture) const { return ShownFrame(picture, track_); }

  // Returns call(), or INVALID_ARGUMENT if OpenCV throws.
  template <class Call>
  absl::Status Try(Call call) const {
    try {
      return call();
    } catch (const cv::Exception& error) {
      return Refused(task_.name, absl::StrCat("OpenCV: ", error.what()));
    }
  }

  // Number of frames that the file declares. 0: unknown. It may be wrong.
  int64_t num_declared() const { return num_declared_; }

 private:
  absl::Status OpenDecoder(const std::string& path) {
    ASSIGN_OR_RETURN(void* const open, LoadModule("video", kOpenVideo));
    video_.reset(reinterpret_cast<OpenVideoFn*>(open)(path.c_str()));
    if (video_ == nullptr) return Refused(task_.name, "is not a video that FFmpeg can read");
    RETURN_IF_ERROR(CheckPixels(video_->width(), video_->height()));
    num_declared_ = std::max<int64_t>(video_->num_frames(), 0);
    return num_declared_ > kMaxVideoFrames ? TooLong() : absl::OkStatus();
  }

  absl::Status CheckPixels(int64_t width, int64_t height) const {
    if (width >= 1 && height >= 1 && width * height <= kMaxVideoPixels) {
      return absl::OkStatus();
    }
    return Refused(task_.name, absl::StrCat(width, "x", height, " pixels, allowed are up to ",
                                            kMaxVideoPixels, " in all"));
  }

  absl::Status TooLong() const {
    return Refused(task_.name,
                   absl::StrCat("over ", kMaxVideoFrames, " frames: upload a shorter video"));
  }

  const VideoTask& task_;
  VideoTrack track_;
  std::unique_ptr<VideoDecoder> video_;
  std::vector<uint8_t> bgr_;  // the picture at hand
  int64_t num_read_ = 0;
  int64_t num_declared_ = 0;
};

// Reports the progress every kFramesPerCall frames.
absl::Status ReportEveryFew(VideoProgressFn progress, int64_t done, int64_t num_frames) {
  return done % kFramesPerCall == 0 ? progress(done, std::max(done, num_frames)) : absl::OkStatus();
}

struct Candidate {
  int64_t frame;
  double sharpness;
};

// First pass: measures the sharpness of every n-th frame, about kCandidates for each window.
// Returns the number of frames that the video really has.
absl::StatusOr<int64_t> FindCandidates(const VideoTask& task, VideoProgressFn progress,
                                       std::vector<Candidate>& candidates) {
  Reader reader(task);
  RETURN_IF_ERROR(reader.Open());
  const int64_t wanted = kCandidates * task.max_frames;
  // If the file declares no number, every frame is measured: slower, but right.
  const int64_t stride = std::max<int64_t>(1, reader.num_declared() / wanted);
  for (int64_t frame = 0;; ++frame) {
    ASSIGN_OR_RETURN(const bool more, reader.Skip());
    if (!more) return frame;
    RETURN_IF_ERROR(ReportEveryFew(progress, frame, 2 * reader.num_declared()));
    if (frame % stride != 0) continue;
    ASSIGN_OR_RETURN(const cv::Mat picture, reader.Picture());
    double sharpness = 0;
    RETURN_IF_ERROR(reader.Try([&] {
      sharpness = Sharpness(picture);
      return absl::OkStatus();
    }));
    candidates.push_back({frame, sharpness});
  }
}

// Returns the sharpest candidate of each window, in order. Windows without candidates are skipped.
std::vector<int64_t> Choose(const std::vector<Candidate>& candidates, int64_t num_frames,
                            int max_frames) {
  std::vector<std::optional<Candidate>> best(static_cast<size_t>(max_frames));
  for (const Candidate& candidate : candidates) {
    auto& window = best[static_cast<size_t>(candidate.frame * max_frames / num_frames)];
    // The first of equally sharp frames stays.
    if (!window || candidate.sharpness > window->sharpness) window = candidate;
  }
  std::vector<int64_t> chosen;
  for (const std::optional<Candidate>& window : best) {
    if (window) chosen.push_back(window->frame);
  }
  return chosen;
}

// Writes frames, except those that hardly differ from the last one written.
class FrameWriter {
 public:
  explicit FrameWriter(const VideoTask& task) : task_(task) {}

  absl::Status Add(int64_t index, const cv::Mat& picture) {
    const cv::Mat small = SmallGrey(picture, kChangeSide);
    if (!last_.empty()) {
      const double change =
          cv::norm(small, last_, cv::NORM_L1) / static_cast<double>(small.total());
      if (change < kLeastChange) return absl::OkStatus();
    }
    last_ = small;
    cv::Mat shrunk = picture;
    const int side = std::max(picture.cols, picture.rows);
    const double scale = static_cast<double>(kMaxFrameSide) / side;
    if (scale < 1) cv::resize(picture, shrunk, cv::Size(), scale, scale, cv::INTER_AREA);
    Image image{shrunk.cols, shrunk.rows, 3, {}};
    image.pixels.resize(3 * shrunk.total());
    cv::Mat rgb(shrunk.size(), CV_8UC3, image.pixels.data());
    cv::cvtColor(shrunk, rgb, cv::COLOR_BGR2RGB);
    ASSIGN_OR_RETURN(const std::string jpeg, EncodeJpeg(image, kJpegQuality));
    const std::filesystem::path path =
        task_.folder / absl::StrFormat("%s_%06d.jpg", task_.prefix, index);
    RETURN_IF_ERROR(WriteFileAtomically(path, jpeg));
    frames_.push_back({index, path});
    return absl::OkStatus();
  }

  absl::StatusOr<std::vector<VideoFrame>> Finish(int64_t num_frames) && {
    if (frames_.size() >= kLeastFrames) return std::move(frames_);
    return absl::FailedPreconditionError(absl::StrCat(
        task_.name, ": the camera hardly moves: of ", num_frames, " frames ", frames_.size(),
        frames_.size() == 1 ? " differs" : " differ", ", at least ", kLeastFrames,
        " are needed; film while walking around the scene, some 20 seconds or more"));
  }

 private:
  const VideoTask& task_;
  cv::Mat last_;
  std::vector<VideoFrame> frames_;
};

// Second pass: decodes and writes the chosen frames.
absl::StatusOr<std::vector<VideoFrame>> WriteChosen(const VideoTask& task, int64_t num_frames,
                                                    const std::vector<int64_t>& chosen,
                                                    VideoProgressFn progress) {
  Reader reader(task);
  RETURN_IF_ERROR(reader.Open());
  FrameWriter writer(task);
  int64_t frame = -1;
  for (const int64_t wanted : chosen) {
    while (frame < wanted) {
      ASSIGN_OR_RETURN(const bool more, reader.Skip());
      if (!more)
        return Refused(task.name, absl::StrCat("ends at frame ", frame + 1, " when read again"));
      ++frame;
      RETURN_IF_ERROR(ReportEveryFew(progress, num_frames + frame, 2 * num_frames));
    }
    ASSIGN_OR_RETURN(const cv::Mat picture, reader.Picture());
    RETURN_IF_ERROR(reader.Try([&] { return writer.Add(wanted, reader.Shown(picture)); }));
  }
  return std::move(writer).Finish(num_frames);
}

}  // namespace

bool IsVideo(std::span<const uint8_t> bytes) {
  constexpr std::array<uint8_t, 4> kMatroska = {0x1a, 0x45, 0xdf, 0xa3};
  if (bytes.size() < 12) return false;
  // MP4 files begin with "ftyp", old QuickTime files with one of the other atoms.
  for (const absl::string_view atom : {"ftyp", "moov", "mdat", "wide", "free", "skip"}) {
    if (HasTag(bytes, 4, atom)) return true;
  }
  return std::equal(kMatroska.begin(), kMatroska.end(), bytes.begin()) ||
         (HasTag(bytes, 0, "RIFF") && HasTag(bytes, 8, "AVI "));
}

absl::StatusOr<std::vector<VideoFrame>> ExtractFrames(const VideoTask& task,
                                                      VideoProgressFn progress) {
  std::vector<Candidate> candidates;
  ASSIGN_OR_RETURN(const int64_t num_frames, FindCandidates(task, progress, candidates));
  if (candidates.empty()) return Refused(task.name, "has no frame that decodes");
  return WriteChosen(task, num_frames, Choose(candidates, num_frames, task.max_frames), progress);
}

}  // namespace pepeseg
