#include "server/worker/worker_sfm.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <string_view>
#include <system_error>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/file_error.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/dataset/video_frames.h"
#include "core/model_files/manifest.h"
#include "core/sfm/estimate_poses.h"

namespace pepeseg {
namespace {

// Steps of a stage that tells of itself more often than it makes one.
class Steps {
 public:
  Steps(const WorkerJob& job, StageLog& stages) : job_(job), stages_(stages) {}

  absl::Status Tell(const StepReport& report) {
    const bool is_new = report.step != last_ || report.activity != activity_;
    if (!is_new && !job_.stop.stop) return absl::OkStatus();
    last_ = report.step;
    activity_ = report.activity;
    return stages_.Step(report);
  }

 private:
  const WorkerJob& job_;
  StageLog& stages_;
  int64_t last_ = 0;
  std::string_view activity_;
};

// A video's frames are v0_000123.jpg of the first video, v1_... of the second: what its owner calls
// it is no path of ours.
std::string FramePrefix(size_t video) { return absl::StrCat("v", video); }

// "images/walk_000123.jpg" of videos/walk.mp4, or of images/walk.mp4.
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

bool IsFrameOfJob(const WorkerJob& job, const std::filesystem::path& path) {
  for (int64_t fence = job.spec.fence; fence > 0; --fence) {
    if (path.parent_path() == job.folder.frames(fence)) return true;
  }
  return false;
}

// The frames that this attempt or an earlier one has written, all of them; or none.
std::optional<std::filesystem::path> FindFrames(const WorkerJob& job) {
  for (int64_t fence = job.spec.fence; fence > 0; --fence) {
    const std::filesystem::path folder = job.folder.frames(fence);
    const absl::StatusOr<Manifest> manifest = ReadManifest(folder);
    if (manifest.ok() && VerifyManifest(folder, *manifest).ok()) return folder;
  }
  return std::nullopt;
}

absl::Status WriteFrames(const WorkerJob& job, const std::vector<DatasetFile>& videos,
                         int max_frames, StageLog& stages) {
  const std::filesystem::path folder = job.folder.frames(job.spec.fence);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return FileError(folder, "create", error.value());
  std::vector<std::string> names;
  for (size_t i = 0; i < videos.size(); ++i) {
    const VideoTask task{videos[i].path, videos[i].name, folder, FramePrefix(i), max_frames};
    Steps steps(job, stages);
    const auto tell = [&](int64_t done, int64_t num_frames) {
      StepReport report;
      report.stage = "prepare";
      report.step = done;
      report.num_steps = num_frames;
      report.activity = "extracting";
      report.unit = "frames";
      return steps.Tell(report);
    };
    ASSIGN_OR_RETURN(const std::vector<VideoFrame> frames, ExtractFrames(task, tell));
    for (const VideoFrame& frame : frames) names.push_back(frame.path.filename().string());
    spdlog::info("{}: {} frames", videos[i].name, frames.size());
  }
  ASSIGN_OR_RETURN(const Manifest manifest, BuildManifest(folder, names));
  return WriteManifest(folder, manifest);
}

absl::StatusOr<EstimatedPoses> FindOrEstimate(const WorkerJob& job, const SfmOptions& options,
                                              StageLog& stages,
                                              const std::vector<SfmPhotograph>& photographs) {
  for (int64_t fence = job.spec.fence - 1; fence > 0; --fence) {
    absl::StatusOr<EstimatedPoses> earlier = ReadEstimatedPoses(job.folder.poses(fence));
    if (!earlier.ok()) continue;
    spdlog::info("poses were estimated by attempt {}", fence);
    return earlier;
  }
  const SfmPlaces places{job.colmap, job.folder.attempt(job.spec.fence) / "sfm",
                         job.folder.poses(job.spec.fence), job.folder.sfm_log(),
                         job.spec.num_threads};
  Steps steps(job, stages);
  return EstimatePoses(photographs, places, options,
                       [&](const StepReport& report) { return steps.Tell(report); });
}

}  // namespace

absl::Status AppendVideoFrames(const WorkerJob& job, const SfmOptions& options, StageLog& stages,
                               std::vector<DatasetFile>& files) {
  const std::vector<DatasetFile> videos = Videos(files);
  if (videos.empty()) return absl::OkStatus();
  for (const DatasetFile& video : videos) RETURN_IF_ERROR(ValidateName(video.name));
  const Polling polling(job.stop);
  std::optional<std::filesystem::path> folder = FindFrames(job);
  if (!folder) {
    RETURN_IF_ERROR(WriteFrames(job, videos, options.max_video_frames, stages));
    folder = job.folder.frames(job.spec.fence);
  }
  ASSIGN_OR_RETURN(const Manifest manifest, ReadManifest(*folder));
  for (const ManifestEntry& entry : manifest.files) {
    size_t video = 0;
    const absl::string_view name = entry.name;
    const bool known = name.size() > 1 && name.find('_') != absl::string_view::npos &&
                       absl::SimpleAtoi(name.substr(1, name.find('_') - 1), &video) &&
                       video < videos.size();
    if (!known) return absl::DataLossError(absl::StrCat(folder->string(), ": what is ", name, "?"));
    files.push_back({FileKind::kImage, PhotographName(videos[video], name), *folder / entry.name});
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<SfmPhotograph>> PhotographsWithoutPoses(
    const WorkerJob& job, const std::vector<DatasetFile>& files) {
  for (const DatasetFile& file : files) {
    if (file.kind != FileKind::kGaussians && file.kind != FileKind::kPoints) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        file.name, " stands in the frame of poses that are not among the files: upload those (",
        "COLMAP's sparse/0/cameras and images), or the photographs without it"));
  }
  ASSIGN_OR_RETURN(std::vector<SfmPhotograph> photographs, ReadSfmPhotographs(files));
  for (SfmPhotograph& photograph : photographs) {
    photograph.is_video_frame = IsFrameOfJob(job, photograph.path);
  }
  return photographs;
}

absl::StatusOr<PosesMade> AppendPoses(const WorkerJob& job, const SfmOptions& options,
                                      StageLog& stages,
                                      const std::vector<SfmPhotograph>& photographs,
                                      std::vector<DatasetFile>& files) {
  const Polling polling(job.stop);
  ASSIGN_OR_RETURN(const EstimatedPoses poses, FindOrEstimate(job, options, stages, photographs));
  files.push_back({FileKind::kPoses, "sparse/0/cameras.bin", poses.cameras});
  files.push_back({FileKind::kPoses, "sparse/0/images.bin", poses.images});
  files.push_back({FileKind::kPoints, "sparse/0/points3D.bin", poses.points});
  return PosesMade{poses.program,
                   {{"num_registered", static_cast<double>(poses.num_registered)},
                    {"num_photographs", static_cast<double>(photographs.size())},
                    {"reprojection_error", poses.reprojection_error}}};
}

}  // namespace pepeseg
