#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace genu::report {

/** A results folder that appears whole or not at all.

 Files are written to a hidden staging folder beside the target and moved by commit(); a destructor without commit
 removes the staging folder, so a failing run leaves nothing. A folder that holds an earlier run is updated: the files
 listed in its summary.json are removed first, files of others stay. */
class OutputFolder {
 public:
  /** Creates the staging folder. @throws InputError as check() */
  explicit OutputFolder(const std::filesystem::path& folder);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /** Tests, without creating anything, that results can be written to `folder`, so that a long run does not fail at
   its end.
   @throws InputError when it is a file, cannot be written, or holds files with the names of ours that no earlier run
   wrote */
  static void check(const std::filesystem::path& folder);

  /** Where to write `relative`; its folders are made. */
  std::filesystem::path file(const std::filesystem::path& relative);
  const std::filesystem::path& staging() const { return staging_; }
  /** Every file written so far, relative to the folder, sorted. */
  std::vector<std::string> listFiles() const;

  /** Moves everything to the target. @throws InputError when the file system refuses */
  void commit();

 private:
  std::filesystem::path folder_, staging_;
  bool committed_ = false;
};

}  // namespace genu::report
