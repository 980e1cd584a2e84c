#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "server/store/store.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {

// An empty store that a test can close and open again.
class StoreTest : public ::testing::Test {
 protected:
  StoreTest() : url_(testing::NewTestDatabase(folder_.path())) { Reopen(); }

  void Reopen() {
    store_.reset();
    auto store = Store::Open(url_);
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = std::move(store).value();
  }

  void MakeScene(const std::string& id) {
    const auto scene = store_->scenes().CreateScene({id, "Name of " + id, "", {}});
    ASSERT_TRUE(scene.ok()) << scene.status();
  }

  // Creates a scene with the sealed dataset 1.
  void MakeTrainable(const std::string& id) {
    MakeScene(id);
    ASSERT_TRUE(
        store_->datasets().CreateDataset(id, "", {{"images/a.jpg", 1, 3, "00", true}}).ok());
    ASSERT_TRUE(store_->datasets().SealDataset(id, 1).ok());
  }

  absl::StatusOr<JobRow> Train(const std::string& scene, const std::string& request_id = "") {
    JobRow job;
    job.scene = scene;
    job.dataset = 1;
    job.options = std::string("\0opt\xff", 5);
    job.effective_options = "effective";
    job.request_id = request_id;
    return store_->jobs().CreateJob(job);
  }

  testing::TempFolder folder_;
  std::string url_;
  std::unique_ptr<Store> store_;
};

}  // namespace pepeseg
