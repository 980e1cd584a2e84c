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

// The quotas in force for each project, cached for a second so that not every query asks the store,
// and the rate of each project's queries to this server. Quota.queries_per_second says which calls
// are queries.
// Thread safe. Blocks on the store about once a second for each project.
class ProjectQuotas {
 public:
  explicit ProjectQuotas(Store* store) : store_(store) {}

  // Returns the limits in force: the project's own, else the server's.
  absl::StatusOr<Quota> Get(const std::string& project);
  // Drops the cached quota of a project, because it has changed.
  void Forget(const std::string& project);

  // Returns whether a call with this request may proceed, and counts it. A project may send
  // `queries_per_second` queries a second, with bursts of up to one second's worth. UNAVAILABLE
  // with retry_after: it sends more. Other calls are always admitted.
  absl::Status Admit(const std::string& project, const google::protobuf::Message& request);
  // In the following, `credential` is a digest of what a caller shows, so that the memory holds no
  // secrets.

  // Decides like Admit, but before the call is authorised and without asking the store: for a
  // credential that `Know` has recorded and a quota that was read at most two seconds ago. Returns
  // nullopt if that is not known or the call is not a query: then call Admit after authorisation.
  std::optional<absl::Status> AdmitAtOnce(const std::string& credential,
                                          const google::protobuf::Message& request);
  // Records that the credential has just been authorised for the project. Does nothing unless
  // `request` is a query.
  void Know(const std::string& credential, const std::string& project,
            const google::protobuf::Message& request);
  // Returns the project of a credential that `Know` has recorded, else a name that only this
  // credential has. Does not block.
  std::string OwnerOf(const std::string& credential);
  // Returns the admitted queries per second, averaged over the last ten seconds and rounded up.
  int64_t QueryRate(const std::string& project);

 private:
  static constexpr int kSeconds = 10;
  struct Project {
    Quota quota;
    absl::Time read = absl::InfinitePast();  // when `quota` was read from the store
    double tokens = 0;                       // queries that could be admitted at `filled`
    absl::Time filled = absl::InfinitePast();
    std::array<int64_t, kSeconds> admitted{};  // queries, in a ring by second
    int64_t newest_second = 0;                 // of the ring, since 1970
  };
  // The project of a credential.
  struct Opened {
    std::string project;
    absl::Time known;  // when it was authorised last
  };
  absl::Status AdmitQuery(const std::string& project, double per_second);
  // Token bucket. The caller must hold mutex_.
  static absl::Status TakeToken(Project& known, double per_second, absl::Time now);
  // Advances the ring to `now`. The caller must hold mutex_.
  static void TurnRing(Project& project, absl::Time now);

  Store* const store_;
  std::mutex mutex_;  // guards both maps
  std::map<std::string, Project> projects_;
  std::map<std::string, Opened> opened_;  // by credential
};

}  // namespace pepeseg
