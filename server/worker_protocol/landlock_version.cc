#include "server/worker_protocol/landlock_version.h"

#include <linux/landlock.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>

namespace pepeseg {

int LandlockVersion() {
  const long version =
      syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  return static_cast<int>(std::max(version, 0L));
}

std::string MissingFromSandbox(int landlock_version) {
  if (landlock_version < kLandlockRefer) {
    return "this kernel has no Landlock (Linux 5.19 or later, enabled at boot): files are not "
           "limited, so that a job may read and write every file of this user";
  }
  if (landlock_version < kLandlockScopes) {
    return "this kernel is older than Linux 6.12: a program that a job runs may send signals to "
           "other processes of this user";
  }
  return "";
}

}  // namespace pepeseg
