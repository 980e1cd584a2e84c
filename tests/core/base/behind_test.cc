#include "core/base/behind.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <future>
#include <thread>
#include <vector>

namespace pepeseg {
namespace {

TEST(Behind, DoesThePiecesInOrder) {
  std::vector<int> done;
  Behind behind;
  for (int i = 0; i < 50; ++i) behind.Do([&done, i] { done.push_back(i); });
  behind.Wait();
  ASSERT_EQ(done.size(), 50u);
  EXPECT_TRUE(std::ranges::is_sorted(done));
}

TEST(Behind, WorksOnAnotherThreadAndWaitsAtItsEnd) {
  std::promise<void> go;
  std::thread::id worker;
  {
    Behind behind;
    behind.Do([&] {
      go.get_future().wait();
      worker = std::this_thread::get_id();
    });
    go.set_value();
  }
  EXPECT_NE(worker, std::thread::id());
  EXPECT_NE(worker, std::this_thread::get_id());
}

}  // namespace
}  // namespace pepeseg
