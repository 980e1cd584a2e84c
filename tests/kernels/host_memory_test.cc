#include "kernels/host_memory.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

constexpr int64_t kMib = 1 << 20;

// A folder with the files of a machine that has 1000 MiB, of which 600 are available.
struct HostMemoryTest : ::testing::Test {
  HostMemoryTest() {
    Write("proc/meminfo", "MemTotal:  1024000 kB\nMemFree: 1 kB\nMemAvailable:  614400 kB\n");
  }
  void Write(const std::string& path, const std::string& text) {
    std::filesystem::create_directories((root / path).parent_path());
    std::ofstream(root / path) << text;
  }
  // Expects this much memory, in MiB.
  void ExpectMib(int64_t free, int64_t total) {
    const DeviceMemory memory = HostMemory(root.path().string());
    EXPECT_EQ(memory.free_bytes, free * kMib);
    EXPECT_EQ(memory.total_bytes, total * kMib);
    EXPECT_TRUE(memory.is_host);
  }

  const testing::TempFolder root;
};

TEST_F(HostMemoryTest, ReportsTheMachineWithoutControlGroups) { ExpectMib(600, 1000); }

TEST_F(HostMemoryTest, TakesTheLeastOfAGroupAndThoseAboveIt) {
  Write("proc/self/cgroup", "0::/pods/one\n");
  Write("sys/fs/cgroup/pods/one/memory.max", "max\n");
  Write("sys/fs/cgroup/pods/one/memory.current", "10485760\n");
  ExpectMib(600, 1000);                                                         // no limit
  Write("sys/fs/cgroup/pods/memory.max", "314572800\n");                        // 300 MiB
  Write("sys/fs/cgroup/pods/memory.current", "209715200\n");                    // 200 MiB
  Write("sys/fs/cgroup/pods/memory.stat", "anon 5\ninactive_file 52428800\n");  // 50 MiB
  // Pages of the inactive file cache count as free: 300 - 200 + 50.
  ExpectMib(150, 300);
  Write("sys/fs/cgroup/pods/one/memory.max", "104857600\n");  // 100 MiB
  ExpectMib(90, 100);
}

TEST_F(HostMemoryTest, ReadsVersionOneOfControlGroups) {
  Write("proc/self/cgroup", "5:cpu,memory:/none\n4:memory:/docker/abc\n0::/\n");
  // In a container its own group is mounted as the root, while the path is the host's.
  Write("sys/fs/cgroup/memory/memory.limit_in_bytes", "209715200\n");
  Write("sys/fs/cgroup/memory/memory.usage_in_bytes", "104857600\n");
  ExpectMib(100, 200);
  Write("sys/fs/cgroup/memory/docker/abc/memory.limit_in_bytes", "52428800\n");
  Write("sys/fs/cgroup/memory/docker/abc/memory.usage_in_bytes", "0\n");
  ExpectMib(50, 50);
}

}  // namespace
}  // namespace pepeseg
