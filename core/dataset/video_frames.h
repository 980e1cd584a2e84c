#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace pepeseg {

// Limits of a video.
inline constexpr int64_t kMaxVideoFrames = 108'000;      // half an hour at 60 frames per second
inline constexpr int64_t kMaxVideoPixels = 8192 * 8192;  // width * height
// Maximum of the longer side of frames that are written, pixels.
inline constexpr int kMaxFrameSide = 1600;

// Core seconds that ExtractFrames takes for each megapixel of each frame that the video has.
// Measured: 150 frames of MPEG-4, 1280x720, on x86-64.
inline constexpr double kVideoCoreSeconds = 0.013;

// Returns how many frames of a video with `num_frames` ExtractFrames is expected to write; 0 is
// unknown.
constexpr int64_t ExpectedFrames(int64_t num_frames, int64_t max_frames) {
  return num_frames > 0 ? std::min(num_frames, max_frames) : max_frames;
}

// Returns true if a file begins like a video of a supported format: MP4, MOV, WebM, MKV or AVI.
bool IsVideo(std::span<const uint8_t> bytes);

struct VideoFrame {
  int64_t index = 0;  // in the video, from 0
  std::filesystem::path path;
};

struct VideoTask {
  std::filesystem::path path;    // the video
  std::string name;              // the owner's name of it, for errors
  std::filesystem::path folder;  // where frames are written; it must exist
  std::string prefix;            // frames are named PREFIX_000123.jpg
  int max_frames = 120;          // maximum number of frames that are written
};

// Called every few frames with the number of frames read so far and the expected total. An error
// that it returns ends the work with that error.
using VideoProgressFn = absl::FunctionRef<absl::Status(int64_t done, int64_t num_frames)>;

// Writes frames that represent a video, upright by its rotation, as JPEGs of quality 95 whose
// longer side is at most kMaxFrameSide pixels. Divides the video into max_frames equal windows and
// takes the sharpest frame of each (variance of the Laplacian), unless it hardly differs from the
// last one that was written. Reads the file twice, so memory does not grow with the video.
//
// INVALID_ARGUMENT, naming the video: its first bytes are not those of a video, it does not decode,
// or it exceeds the limits above. FAILED_PRECONDITION: the camera does not move in it.
absl::StatusOr<std::vector<VideoFrame>> ExtractFrames(const VideoTask& task,
                                                      VideoProgressFn progress);

}  // namespace pepeseg
