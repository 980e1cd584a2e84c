#include "core/train/prepare_files.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "core/base/digest.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/dataset/video_frames.h"
#include "core/formats/gaussian_ply.h"
#include "core/formats/heic.h"
#include "core/formats/heic_header.h"
#include "core/formats/images.h"
#include "core/model_files/manifest.h"
#include "kernels/thread_pool.h"

namespace pepeseg {
namespace {

// A stored file, and its digest or the error once it was read.
struct StoredFile {
  std::filesystem::path path;
  absl::StatusOr<std::string> found;
};

// Returns the stored files, each once: files with the same bytes share one path.
std::vector<StoredFile> DistinctFiles(const TrainingInputs& inputs) {
  std::vector<StoredFile> stored;
  std::set<std::filesystem::path> known;
  for (const DatasetFile& file : inputs.files) {
    if (known.insert(file.path).second) stored.push_back({file.path, ""});
  }
  return stored;
}

// Returns the sum of the sizes for the log; files that are gone count 0.
int64_t BytesOf(const std::vector<StoredFile>& stored) {
  int64_t bytes = 0;
  for (const StoredFile& file : stored) {
    std::error_code error;
    const auto size = std::filesystem::file_size(file.path, error);
    if (!error) bytes += static_cast<int64_t>(size);
  }
  return bytes;
}

void HashAll(int num_threads, std::vector<StoredFile>& stored, TrainingObserver& observer) {
  const absl::Time start = absl::Now();
  ThreadPool pool(num_threads);
  pool.ParallelFor(static_cast<int64_t>(stored.size()), [&](int64_t i, int) {
    StoredFile& file = stored[static_cast<size_t>(i)];
    file.found = Sha256OfFile(file.path);
  });
  const double seconds = absl::ToDoubleSeconds(absl::Now() - start);
  const double megabytes = static_cast<double>(BytesOf(stored)) / 1e6;
  observer.Log(absl::StrFormat("verified %d stored files: %.1f MB in %.3f s, %.0f MB/s",
                               stored.size(), megabytes, seconds,
                               megabytes / std::max(seconds, 1e-6)));
}

// Returns true for a HEIC file, by its first bytes: phones also upload HEIC files named ".jpg".
bool BeginsAsHeic(const std::filesystem::path& path) {
  std::array<char, 16> start{};
  std::ifstream file(path, std::ios::binary);
  file.read(start.data(), start.size());
  return file.gcount() == start.size() &&
         IsHeic({reinterpret_cast<const uint8_t*>(start.data()), start.size()});
}

// Returns a name made of the index among the files: the owner's name is never used as a path.
std::string JpegName(size_t index) { return absl::StrFormat("%06d.jpg", index); }

absl::Status ConvertHeicFile(const DatasetFile& file, const std::filesystem::path& jpeg) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(file.path, file.name, kMaxImageFileBytes));
  ASSIGN_OR_RETURN(
      const std::string converted,
      HeicToJpeg({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}, file.name));
  return WriteFileAtomically(jpeg, converted);
}

// Writes the JPEGs, and the manifest last: a later run does not use a folder without one.
absl::StatusOr<std::filesystem::path> ConvertAll(const TrainingFolders& folders, StageLog& stages,
                                                 const std::vector<DatasetFile>& files,
                                                 const std::vector<size_t>& heic) {
  const std::filesystem::path folder = folders.run / kHeicFolder;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return FileError(folder, "create", error.value());
  std::vector<std::string> names;
  for (const size_t index : heic) {
    StepReport report;
    report.step = static_cast<int64_t>(names.size());
    report.num_steps = static_cast<int64_t>(heic.size());
    report.activity = "converting";
    report.unit = "photographs";
    RETURN_IF_ERROR(stages.Step(report));
    names.push_back(JpegName(index));
    RETURN_IF_ERROR(ConvertHeicFile(files[index], folder / names.back()));
  }
  ASSIGN_OR_RETURN(const Manifest manifest, BuildManifest(folder, names));
  RETURN_IF_ERROR(WriteManifest(folder, manifest));
  return folder;
}

// Returns the prefix of a video's frames, as in v0_000123.jpg of the first video: the owner's name
// is never used as a path.
std::string FramePrefix(size_t video) { return absl::StrCat("v", video); }

// Returns "images/walk_000123.jpg" for a frame of videos/walk.mp4 or images/walk.mp4.
std::string PhotographName(const DatasetFile& video, absl::string_view frame_file) {
  // frame_file is "v0_000123.jpg": its number with the suffix is kept.
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

// Writes the frames of all videos, and the manifest last: a later run does not use a folder without
// one.
absl::Status WriteFrames(const std::filesystem::path& folder,
                         const std::vector<DatasetFile>& videos, int max_frames, StageLog& stages) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return FileError(folder, "create", error.value());
  std::vector<std::string> names;
  for (size_t i = 0; i < videos.size(); ++i) {
    const VideoTask task{videos[i].path, videos[i].name, folder, FramePrefix(i), max_frames};
    const auto report = [&](int64_t done, int64_t num_frames) {
      return stages.StepIfNew(
          {.step = done, .num_steps = num_frames, .activity = "extracting", .unit = "frames"});
    };
    ASSIGN_OR_RETURN(const std::vector<VideoFrame> frames, ExtractFrames(task, report));
    for (const VideoFrame& frame : frames) names.push_back(frame.path.filename().string());
    stages.observer().Log(absl::StrCat(videos[i].name, ": ", frames.size(), " frames"));
  }
  ASSIGN_OR_RETURN(const Manifest manifest, BuildManifest(folder, names));
  return WriteManifest(folder, manifest);
}

// Returns the index of the video that a frame's file belongs to; nullopt: it is not named as one.
std::optional<size_t> VideoOf(absl::string_view frame_file, size_t num_videos) {
  const size_t end = frame_file.find('_');
  size_t video = 0;
  if (end == absl::string_view::npos || end < 1) return std::nullopt;
  if (!absl::SimpleAtoi(frame_file.substr(1, end - 1), &video)) return std::nullopt;
  return video < num_videos ? std::optional<size_t>(video) : std::nullopt;
}

}  // namespace

// Lists damaged files in the order of the inputs, so that the message does not depend on threads.
absl::Status CheckGivenGaussians(const std::vector<DatasetFile>& files) {
  for (const DatasetFile& file : files) {
    if (file.kind != FileKind::kGaussians) continue;
    RETURN_IF_ERROR(ReadGaussianPly(file.path, file.name).status());
  }
  return absl::OkStatus();
}

absl::Status VerifyFiles(const TrainingInputs& inputs, TrainingObserver& observer) {
  if (inputs.sha256.empty()) return absl::OkStatus();
  std::vector<StoredFile> stored = DistinctFiles(inputs);
  HashAll(inputs.tools.num_threads, stored, observer);
  std::map<std::filesystem::path, const StoredFile*> by_path;
  for (const StoredFile& file : stored) by_path[file.path] = &file;
  std::string first;
  int num_files = 0;
  std::set<std::string> digests;
  for (size_t i = 0; i < inputs.files.size(); ++i) {
    const std::string& name = inputs.files[i].name;
    const absl::StatusOr<std::string>& found = by_path.at(inputs.files[i].path)->found;
    // A disk that fails to read is not the owner's to repair by an upload.
    if (!found.ok() && !absl::IsNotFound(found.status())) {
      return absl::InternalError(absl::StrCat(name, ": cannot be read"));
    }
    if (found.ok() && *found == inputs.sha256[i]) continue;
    if (++num_files == 1) {
      first = absl::StrCat(name, ": its stored bytes are ", found.ok() ? "damaged" : "gone");
    }
    // Files with the same bytes share one stored file: each digest is reported once.
    if (digests.insert(inputs.sha256[i]).second) observer.ReportDamagedFile(inputs.sha256[i]);
  }
  if (num_files == 0) return absl::OkStatus();
  if (num_files > 1) absl::StrAppend(&first, ", as are those of ", num_files - 1, " more files");
  return absl::DataLossError(
      absl::StrCat(first, "; upload the same files again, then train again"));
}

absl::Status ConvertHeicPhotographs(const TrainingFolders& folders, StageLog& stages,
                                    std::vector<DatasetFile>& files) {
  std::vector<size_t> heic;
  for (size_t i = 0; i < files.size(); ++i) {
    if (files[i].kind == FileKind::kImage && BeginsAsHeic(files[i].path)) heic.push_back(i);
  }
  // Indices among the files name the JPEGs, and the files of a training never change: an earlier
  // run's folder fits.
  if (heic.empty()) return absl::OkStatus();
  std::optional<std::filesystem::path> folder = FindWhole(folders, kHeicFolder);
  if (!folder) {
    const Polling polling(stages.observer());
    ASSIGN_OR_RETURN(folder, ConvertAll(folders, stages, files, heic));
  }
  for (const size_t index : heic) files[index].path = *folder / JpegName(index);
  return absl::OkStatus();
}

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
