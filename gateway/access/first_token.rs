//! The token that the first start prints. It may stand in the log of a container or on a screen, so it signs in once, within a day, at the
//! form only; `cnc-gateway setup` and a new token for the same person end it at once.

use super::sign_in::{Access, SignInError};
use gateway_base::clock::now_ns;
use gateway_base::convert::instant_to_seconds;
use std::net::IpAddr;

impl Access {
    /// The token of the first start is good for the form, once, in its time; `by_form` says whether it came so.
    pub(super) fn check_first_token(&self, name: &str, from: IpAddr, by_form: bool) -> Result<(), SignInError> {
        let first = self.first_token_of(name);
        if first.is_none_or(|first| by_form && first.is_valid_at(instant_to_seconds(now_ns()))) {
            return Ok(());
        }
        let text = format!("from {from}: the token of the first start was used, is too old, or came without the form");
        self.record_refusal_of("login", &text, name);
        Err(SignInError::FirstToken)
    }

    /// Where the token was that of the first start, it signs in no more. That must stand in the file before the session begins.
    pub(super) async fn spend_first_token(&self, name: &str) -> Result<(), SignInError> {
        if self.first_token_of(name).is_none() {
            return Ok(());
        }
        match self.change_persons(|persons| Ok(persons.mark_first_used(name))).await {
            Ok(true) => Ok(()),
            // Another sign-in with the same token was faster.
            Ok(false) => Err(SignInError::FirstToken),
            Err(error) => Err(SignInError::Unreadable(error.to_string())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::persons::Persons;
    use crate::{FirstToken, Role, Rules, Token, Urgency, persons_path};
    use gateway_control::create_queues;
    use std::path::Path;
    use std::time::Duration;

    fn open(directory: &Path) -> (Access, Option<Token>) {
        let rules = Rules { tokens_always: true, session: Duration::from_secs(60), allow_arming: false };
        // Nobody takes the rows of the audit; they are dropped.
        let (sender, _receiver) = create_queues();
        Access::open(persons_path(directory), rules, sender)
    }

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    #[tokio::test]
    async fn the_token_of_the_first_start_signs_in_once_and_in_its_time() {
        let directory = tempfile::tempdir().expect("a directory");
        let (access, token) = open(directory.path());
        let token = token.expect("the first one");
        let bearer = format!("admin:{}", token.text());
        assert_eq!(access.of_bearer(&bearer, HERE, Urgency::Waits).await, Err(SignInError::FirstToken));
        assert!(access.of_bearer(&bearer, HERE, Urgency::GivesBack).await.is_ok(), "the machine is given back");
        let after = access.of_bearer(&bearer, HERE, Urgency::Waits).await;
        assert_eq!(after, Err(SignInError::FirstToken), "giving back opens nothing else");
        let cookie = access.sign_in("admin", &token, HERE).await.expect("once").cookie;
        assert!(access.of_cookie(&cookie).is_some(), "the session goes on");
        assert_eq!(access.sign_in("admin", &token, HERE).await, Err(SignInError::FirstToken));
        let (again, none) = open(directory.path());
        assert!(none.is_none());
        assert_eq!(again.sign_in("admin", &token, HERE).await, Err(SignInError::FirstToken), "after a start too");
        let own = access.change_persons(|persons| persons.give_token("admin", "admin")).await.expect("a token");
        for _ in 0..2 {
            assert!(access.sign_in("admin", &own, HERE).await.is_ok(), "a token of one's own lasts");
        }
        let first = FirstToken { until_s: 100, has_signed_in: false };
        assert!(first.is_valid_at(99) && !first.is_valid_at(100));
    }

    #[test]
    fn whoever_sets_the_box_up_takes_the_place_of_the_first_one() {
        let mut persons = Persons::default();
        let first = persons.add_first(0).expect("made");
        assert!(persons.replace_first("", "setup").is_err());
        assert_eq!(persons.list_entries().len(), 1, "a refused name changes nothing");
        let (token, revoked) = persons.replace_first("admin", "setup").expect("made");
        let entry = persons.find_by_name("admin").expect("there").clone();
        assert!(revoked && token.matches_hash(&entry.token_hash) && !first.matches_hash(&entry.token_hash));
        let (_, revoked) = persons.replace_first("Li", "setup").expect("made");
        assert!(!revoked && persons.list_entries().len() == 2);
    }

    #[tokio::test]
    async fn a_file_that_cannot_be_read_is_told_and_keeps_no_override_in_force() {
        let directory = tempfile::tempdir().expect("a directory");
        let file = persons_path(directory.path());
        let mut persons = Persons::default();
        let token = persons.add("Li", Role::Admin, "test").expect("added");
        persons.write(&file).expect("written");
        let (access, _) = open(directory.path());
        assert!(access.find_stand_in("Li").is_none(), "the file can be read");
        let good = std::fs::read(&file).expect("there");
        for damage in ["a folder", "other text", "gone"] {
            std::fs::remove_file(&file).expect("removed");
            match damage {
                "a folder" => std::fs::create_dir(&file).expect("made"),
                "other text" => std::fs::write(&file, "{").expect("written"),
                _ => {}
            }
            access.reload_if_changed().await;
            assert!(access.sign_in("Li", &token, HERE).await.is_ok(), "{damage}: who was known still is");
            let wrong = Token::from_typed_text("aaaa");
            let refused = access.sign_in("Li", &wrong, HERE).await;
            assert!(matches!(refused, Err(SignInError::Unreadable(_))), "{damage}: {refused:?}");
            let back =
                access.check_token("Wu", &wrong, HERE, "disarmed", Urgency::GivesBack).await.expect("given back");
            assert!(back.role == Role::Viewer && back.name.contains("not verified"), "{damage}: {back:?}");
            let change = access.change_persons(|persons| persons.add("Wu", Role::Viewer, "Li")).await;
            assert!(change.is_err(), "{damage}: an unreadable list is no empty one");
            if damage == "a folder" || damage == "other text" {
                let (after, none) = open(directory.path());
                assert!(none.is_none() && after.find_stand_in("").is_some(), "{damage}: after a start");
                let refused = after.sign_in("Li", &token, HERE).await;
                assert!(matches!(refused, Err(SignInError::Unreadable(_))), "{damage}: {refused:?}");
            }
            if damage == "a folder" {
                std::fs::remove_dir(&file).expect("removed");
            }
            std::fs::write(&file, &good).expect("written");
            access.reload_if_changed().await;
            assert!(access.trouble().is_none(), "{damage}");
            assert!(matches!(access.sign_in("Li", &wrong, HERE).await, Err(SignInError::Wrong(_))), "{damage}");
        }
    }
}
