#pragma once

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
inline constexpr int64_t kMaxVideoFrames = 108'000;  // half an hour at 60 a second
inline constexpr int64_t kMaxVideoPixels = 8192 * 8192;
// The longer side of the frames that are written.
inline constexpr int kMaxFrameSide = 1600;

// Whether a file begins as a video that we read: MP4 or MOV, WebM or MKV, AVI.
bool IsVideo(std::span<const uint8_t> bytes);

struct VideoFrame {
  int64_t index = 0;  // of the video's frames, from 0
  std::filesystem::path path;
};

struct VideoTask {
  std::filesystem::path path;    // of the video
  std::string name;              // its owner's, for errors
  std::filesystem::path folder;  // for the frames; it must exist
  std::string prefix;            // of their names: PREFIX_000123.jpg
  int max_frames = 120;
};

// Called with the frames decoded so far and how many there will be, every few of them: an error
// ends the work with that error.
using VideoProgressFn = absl::FunctionRef<absl::Status(int64_t done, int64_t num_frames)>;

// Writes the frames that stand for a video, upright by its rotation, as JPEGs of quality 95 and at
// most kMaxFrameSide pixels: of as many even windows of its frames as there may be frames, the
// sharpest (variance of the Laplacian); those that hardly differ from the one before are left out.
// Reads the file twice. INVALID_ARGUMENT names the video: no video by its first bytes, one that
// does not decode, or over the limits; FAILED_PRECONDITION: the camera does not move in it.
absl::StatusOr<std::vector<VideoFrame>> ExtractFrames(const VideoTask& task,
                                                      VideoProgressFn progress);

}  // namespace pepeseg
