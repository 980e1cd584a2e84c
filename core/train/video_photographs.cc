#include "core/train/video_photographs.h"

#include <algorithm>
#include <optional>
#include <string>
#include <system_error>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/file_error.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/dataset/video_frames.h"
#include "core/model_files/manifest.h"

namespace pepeseg {
namespace {

// Frames of the first video are v0_000123.jpg, of the second v1_...: the owner's name for a video
// is never used as a path.
std::string FramePrefix(size_t video) { return absl::StrCat("v", video); }

// "images/walk_000123.jpg" of videos/walk.mp4 or images/walk.mp4.
std::string PhotographName(const DatasetFile& video, absl::string_view frame_file) {
  const absl::string_view number = frame_file.substr(frame_file.find('_'));
  const absl::string_view name = WithoutFolder(WithoutFolder(video.name, "videos"), "images");
  return absl::StrCat("images/", WithoutSuffix(name), number);
}

std::vector<DatasetFile> Videos(const std::vector<DatasetFile>& files) {
  std::vector<DatasetFile> videos;
  for (const DatasetFile& file : files) {
    if (file.kind == FileKind::kVideo) videos.push_back(file);
  }
  return videos;
}

// Writes the frames of all videos, and the manifest last: a folder without one is not taken by a
// later run.
absl::Status WriteFrames(const std::filesystem::path& folder,
                         const std::vector<DatasetFile>& videos, int max_frames, StageLog& stages) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return FileError(folder, "create", error.value());
  std::vector<std::string> names;
  for (size_t i = 0; i < videos.size(); ++i) {
    const VideoTask task{videos[i].path, videos[i].name, folder, FramePrefix(i), max_frames};
    const auto report = [&](int64_t done, int64_t num_frames) {
      return stages.StepIfNew({.stage = "prepare",
                               .step = done,
                               .num_steps = num_frames,
                               .activity = "extracting",
                               .unit = "frames"});
    };
    ASSIGN_OR_RETURN(const std::vector<VideoFrame> frames, ExtractFrames(task, report));
    for (const VideoFrame& frame : frames) names.push_back(frame.path.filename().string());
    stages.observer().Log(absl::StrCat(videos[i].name, ": ", frames.size(), " frames"));
  }
  ASSIGN_OR_RETURN(const Manifest manifest, BuildManifest(folder, names));
  return WriteManifest(folder, manifest);
}

// The index of the video that a frame's file is of; none: it is not named as a frame.
std::optional<size_t> VideoOf(absl::string_view frame_file, size_t num_videos) {
  const size_t end = frame_file.find('_');
  size_t video = 0;
  if (end == absl::string_view::npos || end < 1) return std::nullopt;
  if (!absl::SimpleAtoi(frame_file.substr(1, end - 1), &video)) return std::nullopt;
  return video < num_videos ? std::optional<size_t>(video) : std::nullopt;
}

}  // namespace

absl::Status AppendVideoFrames(const TrainingFolders& folders, int max_frames, StageLog& stages,
                               std::vector<DatasetFile>& files) {
  const std::vector<DatasetFile> videos = Videos(files);
  if (videos.empty()) return absl::OkStatus();
  for (const DatasetFile& video : videos) RETURN_IF_ERROR(ValidateName(video.name));
  const Polling polling(stages.observer());
  std::optional<std::filesystem::path> folder = FindWhole(folders, kFramesFolder);
  if (!folder) {
    folder = folders.run / kFramesFolder;
    RETURN_IF_ERROR(WriteFrames(*folder, videos, max_frames, stages));
  }
  ASSIGN_OR_RETURN(const Manifest manifest, ReadManifest(*folder));
  for (const ManifestEntry& entry : manifest.files) {
    const std::optional<size_t> video = VideoOf(entry.name, videos.size());
    if (!video) {
      return absl::DataLossError(
          absl::StrCat(folder->string(), ": ", entry.name, " is not a frame of these videos"));
    }
    files.push_back(
        {FileKind::kImage, PhotographName(videos[*video], entry.name), *folder / entry.name});
  }
  return absl::OkStatus();
}

bool IsVideoFrame(const TrainingFolders& folders, const std::filesystem::path& path) {
  const std::vector<std::filesystem::path> runs = folders.all();
  return std::any_of(runs.begin(), runs.end(), [&path](const std::filesystem::path& run) {
    return path.parent_path() == run / kFramesFolder;
  });
}

}  // namespace pepeseg
