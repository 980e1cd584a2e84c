#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/time/time.h"
#include "core/base/child_process.h"
#include "core/sfm/sfm_options.h"

namespace pepeseg {

// Runs commands of the COLMAP program as child processes. Thread safe after Open.
class ColmapProgram {
 public:
  // Finds the program (`name` as for FindProgram) and asks it for its version. Output of all
  // commands is appended to `log`. FAILED_PRECONDITION, with what to do: it is not found, or is not
  // COLMAP.
  static absl::StatusOr<ColmapProgram> Open(const std::string& name,
                                            const std::filesystem::path& log);

  // Returns the version, such as "COLMAP 3.8".
  const std::string& version() const { return version_; }

  struct Command {
    std::string name;                    // "mapper"
    std::vector<std::string> arguments;  // "--option", "value", ...
    // Text of the last line of output when the command fails because it found no result, which is
    // not an error here. Empty: every failure is an error.
    std::string no_result;
  };
  // Runs a command until it ends. DEADLINE_EXCEEDED: it ran past `deadline`. INTERNAL, with its
  // last lines: it failed. Also returns the errors of `watch`, which stop it (see RunChild).
  absl::Status Run(const Command& command, absl::Time deadline, ChildWatchFn watch) const;

 private:
  ColmapProgram(std::filesystem::path program, std::filesystem::path log)
      : program_(std::move(program)), log_(std::move(log)) {}

  std::filesystem::path program_, log_;
  std::string version_;
};

// Computes the progress of COLMAP's feature_extractor, matchers and mapper from their output (of
// COLMAP 3.8), line by line. Ignores lines that it does not know. Not thread safe.
class ColmapProgress {
 public:
  // `work` is the expected work of the three parts, which weighs them in share().
  ColmapProgress(int64_t num_photographs, int64_t num_pairs, const SfmWork& work)
      : num_photographs_(num_photographs), num_pairs_(num_pairs), work_(work) {}

  // Reads one line of output.
  void Read(absl::string_view line);
  // Marks the last part as complete.
  void Finish();

  // Words and numbers of "matching 19 of 60 pairs" for the part that runs. Its steps never fall,
  // and progress never returns to an earlier part. The texts are literals, empty before the first
  // part.
  std::string_view activity() const;
  std::string_view unit() const;
  int64_t step() const { return step_; }
  int64_t num_steps() const { return num_steps_; }
  // Returns the share of the expected work of all parts that is done, in [0, 1]. Never falls.
  double share() const;

  // Number of features of each photograph that was read, by its name in COLMAP.
  const std::map<std::string, int64_t>& num_features() const { return num_features_; }
  // Number of photographs that match at least one other. -1: the mapper has not reported it yet.
  int64_t num_connected() const { return num_connected_; }

 private:
  enum Part { kNone = -1, kExtracting = 0, kMatching = 1, kMapping = 2 };
  // Raises the progress to `done` of `of` in `part`. Does nothing if a later part has begun.
  void Reach(Part part, int64_t done, int64_t of);
  void ReadMatching(absl::string_view counts);

  int64_t num_photographs_, num_pairs_;
  SfmWork work_;
  Part part_ = kNone;
  // How the matcher reports: true: block by block of all pairs; false: photograph by photograph.
  bool by_blocks_ = false;
  int64_t step_ = 0, num_steps_ = 0;
  std::string name_;  // of the photograph that the following lines are about
  std::map<std::string, int64_t> num_features_;
  int64_t num_connected_ = -1;
};

}  // namespace pepeseg
