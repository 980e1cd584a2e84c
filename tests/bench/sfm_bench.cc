// Estimates the poses of scenes from their photographs alone, and compares them with the given
// ones (sparse/0/images). Prints a table in Markdown. Core seconds include those of COLMAP. Usage:
//   pepeseg_sfm_bench [--front own,colmap] [--features own|colmap] [--every n] [--seeds n]
//   [--mapper auto,own,colmap] [--threads n] SCENE...
// --sequence 1: the photographs are compared as frames of a video.
// --features: who finds the features; default: who matches them (--front).
// --mapper: who places the photographs that pepeseg matched; default auto.
// --every n: only each n-th photograph. --seeds n: n runs, of which all but the first see the
// photographs in another order. --ignore 0: without ignore masks. --seconds n: time limit of a run.

#include <sys/resource.h>
#include <unistd.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "core/base/status_macros.h"
#include "core/dataset/dataset_files.h"
#include "core/formats/colmap.h"
#include "core/sfm/estimate_poses.h"
#include "tests/bench/bench_backend.h"
#include "tests/testing/textured_place.h"

namespace pepeseg {
namespace {

struct Flags {
  std::vector<std::string> fronts = {"own", "colmap"}, scenes;
  SfmEngine features = SfmEngine::kAuto;  // that of the front
  std::vector<std::string> mappers = {"auto"};
  size_t every = 1;
  int num_seeds = 1, num_threads = 0, max_seconds = 4 * 3600;
  bool use_ignore = true, in_sequence = false;
};

// Core seconds of this process and of the children that have ended.
double CoreSeconds() { return CoreNow() + CoreSecondsOf(RUSAGE_CHILDREN); }

struct PoseErrors {
  double centers = 0;  // root mean square over that of the true centres' radius
  double degrees = 0;  // mean angle between rotations
};

// Compares after the similarity that fits the estimated centres best to the given ones.
PoseErrors Compare(const std::vector<Pose>& estimated, const std::vector<Pose>& given) {
  const auto centers = [](const std::vector<Pose>& poses) {
    std::vector<Eigen::Vector3d> of_poses;
    for (const Pose& pose : poses) {
      of_poses.push_back(-(pose.rotation.conjugate() * pose.translation));
    }
    return of_poses;
  };
  const std::vector<Eigen::Vector3d> from = centers(estimated), to = centers(given);
  const Eigen::Matrix3d scaled = testing::FitSimilarity(from, to).topLeftCorner<3, 3>();
  const Eigen::Quaterniond world(Eigen::Matrix3d(scaled / std::cbrt(scaled.determinant())));
  PoseErrors errors;
  errors.centers = testing::CenterError(from, to);
  for (size_t i = 0; i < given.size(); ++i) {
    const Eigen::Quaterniond turned = estimated[i].rotation * world.conjugate();
    errors.degrees +=
        turned.angularDistance(given[i].rotation) * 180 / M_PI / static_cast<double>(given.size());
  }
  return errors;
}

struct Measured {
  std::map<std::string, double> core;  // by the activity of the stage
  double sum = 0, wall = 0;
  int64_t num_registered = 0;
  std::string program;  // that placed the photographs
  double reprojection_error = 0;
  PoseErrors errors;
};

absl::StatusOr<std::map<std::string, Pose>> GivenPoses(const std::filesystem::path& scene) {
  const std::filesystem::path folder = scene / "sparse" / "0";
  std::filesystem::path path = folder / "images.bin";
  if (!std::filesystem::exists(path)) path = folder / "images.txt";
  ASSIGN_OR_RETURN(const auto images, ReadColmapImages(path, path.filename().string()));
  std::map<std::string, Pose> poses;
  for (const ColmapImage& image : images) {
    poses[std::filesystem::path(image.name).filename().string()] = image.cam_from_world;
  }
  return poses;
}

SfmEngine EngineOf(const std::string& name) {
  return name == "own" ? SfmEngine::kOwn : name == "colmap" ? SfmEngine::kColmap : SfmEngine::kAuto;
}

absl::StatusOr<Measured> Run(const std::vector<SfmPhotograph>& photographs,
                             const std::map<std::string, Pose>& given, const Flags& flags,
                             SfmEngine front, SfmEngine mapper) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("pepeseg_sfm_bench." + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  const SfmPlaces places{"colmap", folder / "work", folder / "result", folder / "log",
                         flags.num_threads};
  SfmOptions options;
  options.front = front;
  options.mapper = mapper;
  options.features = flags.features == SfmEngine::kAuto ? front : flags.features;
  options.max_seconds = flags.max_seconds;
  if (flags.in_sequence) options.matching = SfmMatching::kSequential;
  const auto backend = MakeCpuBackend(flags.num_threads);
  Measured measured;
  const double wall = Now(), start = CoreSeconds();
  double since = start;
  std::string activity;
  const auto note = [&](const std::string& next) {
    if (next == activity) return;
    measured.core[activity.empty() ? "finding features in" : activity] += CoreSeconds() - since;
    since = CoreSeconds();
    activity = next;
  };
  const auto progress = [&](const StepReport& report) {
    note(std::string(report.activity));
    return absl::OkStatus();
  };
  const auto warn = [](absl::string_view text) {
    std::fprintf(stderr, "%s\n", std::string(text).c_str());
  };
  const absl::StatusOr<EstimatedPoses> poses =
      EstimatePoses(photographs, places, options, {*backend, progress, warn});
  note("end");
  measured.sum = CoreSeconds() - start;
  measured.wall = Now() - wall;
  if (poses.ok()) {
    measured.num_registered = poses->num_registered;
    measured.program = poses->program;
    measured.reprojection_error = poses->reprojection_error;
    ASSIGN_OR_RETURN(const auto images, ReadColmapImages(poses->images, "images.bin"));
    std::vector<Pose> estimated, truth;
    for (const ColmapImage& image : images) {
      const auto found = given.find(std::filesystem::path(image.name).filename().string());
      if (found == given.end()) continue;
      estimated.push_back(image.cam_from_world);
      truth.push_back(found->second);
    }
    if (truth.size() >= 3) measured.errors = Compare(estimated, truth);
  }
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);
  RETURN_IF_ERROR(poses.status());
  return measured;
}

absl::Status MeasureScene(const std::string& scene, const Flags& flags) {
  ASSIGN_OR_RETURN(const auto files, ListDataset(scene));
  ASSIGN_OR_RETURN(const auto given, GivenPoses(scene));
  ASSIGN_OR_RETURN(const std::vector<SfmPhotograph> all, ReadSfmPhotographs(files));
  std::vector<SfmPhotograph> photographs;
  for (size_t i = 0; i < all.size(); i += flags.every) {
    photographs.push_back(all[i]);
    if (!flags.use_ignore) photographs.back().ignore.clear();
  }
  const std::string name = std::filesystem::path(scene).filename().string();
  for (int seed = 0; seed < flags.num_seeds; ++seed) {
    std::mt19937 random(static_cast<uint32_t>(seed));
    if (seed > 0) std::shuffle(photographs.begin(), photographs.end(), random);
    for (const std::string& front : flags.fronts) {
      for (const std::string& mapper : flags.mappers) {
        // Where COLMAP matches, its mapper places.
        if (front == "colmap" && mapper != flags.mappers.front()) continue;
        const std::string row =
            absl::StrFormat("| %s %zu | %s | %s | %d |", name, photographs.size(), front,
                            front == "colmap" ? "colmap" : mapper, seed);
        absl::StatusOr<Measured> run = Run(photographs, given, flags, EngineOf(front),
                                           front == "colmap" ? SfmEngine::kAuto : EngineOf(mapper));
        if (!run.ok()) {
          std::printf("%s %s |\n", row.c_str(), std::string(run.status().message()).c_str());
          continue;
        }
        const double matching = run->core["choosing among"] + run->core["matching"];
        std::printf("%s %.1f | %.2f | %.1f | %.1f | %.1f | %lld | %.3f %% | %.3f | %s |\n",
                    row.c_str(), run->core["finding features in"], matching, run->core["placing"],
                    run->sum, run->wall, static_cast<long long>(run->num_registered),
                    100 * run->errors.centers, run->errors.degrees, run->program.c_str());
        std::fflush(stdout);
      }
    }
  }
  return absl::OkStatus();
}

int Main(const Flags& flags) {
  std::printf(
      "| scene, photographs | front | mapper | seed | features, core s | matches, core s | "
      "mapping, core s "
      "| "
      "sum | wall s | registered | centres | rotation, degrees | placed by |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const std::string& scene : flags.scenes) {
    const absl::Status status = MeasureScene(scene, flags);
    if (status.ok()) continue;
    std::fprintf(stderr, "%s: %s\n", scene.c_str(), std::string(status.message()).c_str());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  pepeseg::Flags flags;
  for (int i = 1; i < argc; ++i) {
    const std::string flag = argv[i];
    if (!flag.starts_with("--")) {
      flags.scenes.push_back(flag);
      continue;
    }
    const std::string value = ++i < argc ? argv[i] : "";
    if (flag == "--features") flags.features = pepeseg::EngineOf(value);
    if (flag == "--mapper") flags.mappers = absl::StrSplit(value, ',');
    if (flag == "--front") flags.fronts = absl::StrSplit(value, ',');
    if (flag == "--every") flags.every = static_cast<size_t>(std::max(1, std::atoi(value.c_str())));
    if (flag == "--seeds") flags.num_seeds = std::atoi(value.c_str());
    if (flag == "--threads") flags.num_threads = std::atoi(value.c_str());
    if (flag == "--seconds") flags.max_seconds = std::atoi(value.c_str());
    if (flag == "--sequence") flags.in_sequence = value == "1";
    if (flag == "--ignore") flags.use_ignore = value != "0";
  }
  return pepeseg::Main(flags);
}
