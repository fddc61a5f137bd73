//! Alone in its process: it takes away the files that others are writing.

use hr_scene::whole_file::{abandon, write_whole};
use std::io::Write;

#[test]
fn what_is_half_written_goes_and_what_is_whole_stays() {
    let folder = std::env::temp_dir().join(format!("hr-scene-abandon-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("the system's temporary folder can be written to");
    let names = || -> Vec<_> {
        let entries = std::fs::read_dir(&folder).expect("the folder exists");
        entries.map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned()).collect()
    };
    write_whole(&folder.join("whole"), |out| out.write_all(b"all of it")).expect("written");
    let halted = write_whole(&folder.join("half"), |out| {
        out.write_all(b"half of it")?;
        out.flush()?;
        assert_eq!(names().len(), 2, "it is begun: {:?}", names());
        drop(abandon());
        assert_eq!(names(), ["whole"], "it is gone");
        Ok(())
    });
    assert!(halted.is_err(), "the writer is told");
    assert_eq!(names(), ["whole"], "nothing is left");
    write_whole(&folder.join("after"), |out| out.write_all(b"more")).expect("written, where the program goes on");
    std::fs::remove_dir_all(&folder).expect("the folder is ours");
}
