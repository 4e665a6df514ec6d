//! Parts of a campaign, and what they are together.

use crate::{NO_CLOCK, NOISY, PROGRAM, read, with, write_whole, written};
use ballbot_campaign::{Campaign, CampaignError, Shard, Source};
use proptest::prelude::*;
use std::fs::{self, File};
use std::path::Path;

fn write_shard(campaign: &Campaign<'_, &Path>, shard: Shard, folder: &Path) {
    let path = folder.join(shard.file_name());
    let file = File::create(&path).unwrap();
    campaign
        .write_shard(shard, (&file, &path), NO_CLOCK, &|| ())
        .unwrap();
}

fn merge(campaign: &Campaign<'_, &Path>, folder: &Path, into: &Path) -> Result<(), CampaignError> {
    let shards = campaign.shards(folder)?;
    let file = File::create(into).unwrap();
    let mut writer = campaign.writer(&file, into).unwrap();
    let each = |row| -> Result<(), CampaignError> {
        writer.push(row).unwrap();
        Ok(())
    };
    shards.for_each(each)?;
    writer.finish().unwrap();
    Ok(())
}

/// Bit for bit, in any number of shards, more than there are runs included.
#[test]
fn shards_together_are_the_whole() {
    with(NOISY, |campaign| {
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().join("whole.parquet");
        write_whole(campaign, &whole);
        for of in [1, 5, 30] {
            let shards = tempfile::tempdir().unwrap();
            Shard::all(of).for_each(|shard| write_shard(campaign, shard, shards.path()));
            let merged = folder.path().join("merged.parquet");
            merge(campaign, shards.path(), &merged).unwrap();
            assert!(
                fs::read(&merged).unwrap() == fs::read(&whole).unwrap(),
                "{of} shards"
            );
        }
        assert_eq!(read(&whole), crate::rows(campaign));
    });
}

proptest! {
    /// Each run is in one shard.
    #[test]
    fn shards_divide_the_runs(runs in 1_u64..1 << 40, of in 1_u32..200) {
        let mut next = 0;
        for shard in Shard::all(of) {
            let (from, until) = shard.runs(runs);
            prop_assert_eq!(from, next);
            prop_assert!(until - from <= runs / u64::from(of) + 1);
            next = until;
        }
        prop_assert_eq!(next, runs);
    }
}

/// What is missing, double, cut off, changed, of another campaign or of another program.
#[test]
fn what_does_not_belong_together_is_refused() {
    with(NOISY, |campaign| {
        let folder = tempfile::tempdir().unwrap();
        let shards: Vec<Shard> = Shard::all(4).collect();
        shards
            .iter()
            .for_each(|shard| write_shard(campaign, *shard, folder.path()));
        let refused = |part: &str| {
            let merged = folder.path().join("merged");
            let message = merge(campaign, folder.path(), &merged)
                .unwrap_err()
                .to_string();
            assert!(message.contains(part), "{part}: {message}");
        };
        let path = |shard: Shard| folder.path().join(shard.file_name());

        fs::remove_file(path(shards[1])).unwrap();
        refused("the runs 6 to 11 are missing");
        assert!(!campaign.has_shard(folder.path(), shards[1]).unwrap());

        // The same runs in a second division.
        let half: Shard = "1/2".parse().unwrap();
        write_shard(campaign, half, folder.path());
        refused("are there twice");
        fs::remove_file(path(half)).unwrap();
        write_shard(campaign, shards[1], folder.path());

        let whole = fs::read(path(shards[2])).unwrap();
        fs::write(path(shards[2]), &whole[..whole.len() - 40]).unwrap();
        refused("cut off");
        assert!(campaign.has_shard(folder.path(), shards[2]).is_err());

        // A bit of a number is changed: nothing but the digest shows it.
        let mut changed = whole.clone();
        changed[200] ^= 1;
        fs::write(path(shards[2]), &changed).unwrap();
        let merged = folder.path().join("merged");
        assert!(merge(campaign, folder.path(), &merged).is_err());
        fs::write(path(shards[2]), &whole).unwrap();
        merge(campaign, folder.path(), &merged).unwrap();
        fs::remove_file(&merged).unwrap();

        let (_kept, file) = written(&NOISY.replace("seed = 3", "seed = 4"));
        let source = Source::load(&file).unwrap();
        let other = Campaign::new(&source, source.folder(), PROGRAM).unwrap();
        write_shard(&other, shards[0], folder.path());
        refused("of another campaign");

        let (_kept, file) = written(NOISY);
        let source = Source::load(&file).unwrap();
        let newer = Campaign::new(&source, source.folder(), "ballbot 9.9").unwrap();
        write_shard(&newer, shards[0], folder.path());
        refused("written by ballbot 9.9");
    });
}

#[test]
fn only_parts_are_shards() {
    for text in ["0/4", "5/4", "4", "a/b", "1/0", "-1/4", "1/4000000"] {
        assert!(text.parse::<Shard>().unwrap_err().contains(text));
    }
}
