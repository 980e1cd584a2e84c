#pragma once

#include <google/protobuf/message.h>

#include <array>
#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/store/quota.h"
#include "server/store/store.h"

namespace pepeseg {

// What holds for each project, kept for a second so that a question need not ask the store, and how
// fast the projects ask questions of this server. Thread safe; blocks on the store once a second
// for a project.
class ProjectQuotas {
 public:
  explicit ProjectQuotas(Store* store) : store_(store) {}

  absl::StatusOr<Quota> Get(const std::string& project);
  // It was changed.
  void Forget(const std::string& project);

  // Whether a call with this request may go on. Of SegmentationService a project has so many a
  // second as its quota says, and can save up one second's: UNAVAILABLE with retry_after.
  absl::Status Admit(const std::string& project, const google::protobuf::Message& request);
  // What Admit would say, in place of it, where that can be told without asking the store: of a
  // credential that `Know` has told of, by a quota read not long ago. None: ask Admit.
  std::optional<absl::Status> AdmitAtOnce(const std::string& credential,
                                          const google::protobuf::Message& request);
  // The credential has opened the project just now, for this request; of other than questions
  // nothing is kept.
  void Know(const std::string& credential, const std::string& project,
            const google::protobuf::Message& request);
  // Admitted ones a second, over the last ten.
  int64_t QueryRate(const std::string& project);

 private:
  static constexpr int kSeconds = 10;
  struct Project {
    Quota quota;
    absl::Time read = absl::InfinitePast();
    // Calls that could be admitted at `filled`.
    double tokens = 0;
    absl::Time filled = absl::InfinitePast();
    std::array<int64_t, kSeconds> admitted{};  // by second, of a ring
    int64_t newest_second = 0;                 // since 1970
  };
  struct Opened {
    std::string project;
    absl::Time known;
  };
  absl::Status AdmitQuery(const std::string& project, double per_second);
  // With the mutex held.
  static absl::Status TakeToken(Project& known, double per_second, absl::Time now);
  static void TurnRing(Project& project, absl::Time now);

  Store* const store_;
  std::mutex mutex_;
  std::map<std::string, Project> projects_;
  std::map<std::string, Opened> opened_;  // by the credential's digest
};

}  // namespace pepeseg
