//! Which results a plan's measurements can yield, and what is missing for each; reported before the
//! measurement starts.

use std::collections::BTreeSet;

use jointrig_protocol::request::Configuration;
use toml::Spanned;

use super::{ConfigurationPlan, Plan, configuration_name, configuration_named, turned};

/// Response points needed to determine a rigid body's motion, and impacts needed to determine its
/// response.
const BODY: usize = 3;
/// An impact counts as along z if the z component of its unit direction exceeds this.
const ALONG_Z: f64 = 0.9;

impl Plan {
    /// What is missing for the contact's own k_T; empty if nothing is.
    pub fn contact_needs(&self) -> Vec<String> {
        let mut needs = Vec::new();
        let struck_b = self.blocks(Configuration::B).filter(|block| self.seen(block, &[2]) >= BODY);
        let struck_b: usize = struck_b.map(|block| self.hit_along_z(block, &[2, 4]).len()).sum();
        if struck_b < BODY {
            needs.push(format!(
                "hits along z on B alone at {BODY} places or more, each with {BODY} points of arm B (grouping 2); there are {struck_b}"
            ));
        }
        let struck = |groupings: &[u8]| -> BTreeSet<&str> {
            let seeing = self.blocks(Configuration::Ajb).filter(|block| self.seen(block, groupings) >= BODY);
            seeing.flat_map(|block| self.hit_along_z(block, &[1, 3])).collect()
        };
        if struck(&[5]).intersection(&struck(&[2])).next().is_none() {
            needs.push(format!(
                "a hit along z on A in AJB with {BODY} points of specimen A (grouping 5) and {BODY} of arm B (grouping 2)"
            ));
        }
        for spot in ["LDV_A", "LDV_B"] {
            if !self.geometry.sensor.iter().any(|sensor| sensor.get_ref().name == spot) {
                needs.push(format!("the position of {spot} in geometry.sensor"));
            }
        }
        needs
    }

    /// What is missing for the stiffness between the arms; empty if nothing is.
    pub fn between_arms_needs(&self) -> Vec<String> {
        let mut needs = Vec::new();
        for (configuration, groupings) in
            [(Configuration::A, &[1][..]), (Configuration::B, &[2]), (Configuration::Ajb, &[1, 2])]
        {
            for grouping in groupings {
                let seen = self.names(
                    configuration,
                    |block| &block.responses,
                    |name| self.response_is(name, &[*grouping]),
                );
                let hit = self.names(
                    configuration,
                    |block| &block.impacts,
                    |name| self.impact_is(name, &[*grouping]),
                );
                let arm = if *grouping == 1 { "A" } else { "B" };
                let name = configuration_name(configuration);
                if seen < BODY {
                    needs.push(format!("{BODY} response points of arm {arm} (grouping {grouping}) in {name}; there are {seen}"));
                }
                if hit < BODY {
                    needs.push(format!("{BODY} impact points of arm {arm} (grouping {grouping}) or more in {name}; there are {hit}"));
                }
            }
        }
        needs
    }

    fn blocks(&self, of: Configuration) -> impl Iterator<Item = &ConfigurationPlan> {
        self.configuration.iter().filter(move |block| configuration_named(block.name.get_ref()) == Some(of))
    }

    /// Number of distinct names in these lists of a configuration that satisfy `wanted`.
    fn names<'p>(
        &'p self,
        of: Configuration,
        list: impl Fn(&'p ConfigurationPlan) -> &'p Vec<Spanned<String>>,
        wanted: impl Fn(&str) -> bool,
    ) -> usize {
        let names = self.blocks(of).flat_map(list).map(|name| name.get_ref().as_str());
        names.filter(|name| wanted(name)).collect::<BTreeSet<&str>>().len()
    }

    /// Number of responses of a block that belong to these groupings.
    fn seen(&self, block: &ConfigurationPlan, groupings: &[u8]) -> usize {
        block.responses.iter().filter(|name| self.response_is(name.get_ref(), groupings)).count()
    }

    /// The impacts of a block on these groupings that push along z.
    fn hit_along_z<'p>(&self, block: &'p ConfigurationPlan, groupings: &[u8]) -> Vec<&'p str> {
        let along = |name: &str| {
            let mut points = self.geometry.impact.iter().map(Spanned::get_ref);
            points.any(|p| p.name == name && turned(&self.to_interface(), p.direction)[2].abs() > ALONG_Z)
        };
        let names = block.impacts.iter().map(|name| name.get_ref().as_str());
        names.filter(|name| along(name) && self.impact_is(name, groupings)).collect()
    }

    fn response_is(&self, name: &str, groupings: &[u8]) -> bool {
        let mut points = self.geometry.response.iter().map(Spanned::get_ref);
        points.any(|p| p.name == name && groupings.contains(&p.grouping))
    }

    fn impact_is(&self, name: &str, groupings: &[u8]) -> bool {
        let mut points = self.geometry.impact.iter().map(Spanned::get_ref);
        points.any(|p| p.name == name && groupings.contains(&p.grouping))
    }
}

#[cfg(test)]
mod tests {
    use crate::campaign::plan::{CONTACT, PAPER, PAPER_CONTACT, Plan, SMALL};

    #[test]
    fn the_plans_answer_what_they_were_made_for() {
        for (text, contact, between) in
            [(CONTACT, true, false), (PAPER, false, true), (PAPER_CONTACT, true, true), (SMALL, false, false)]
        {
            let plan = Plan::parse(text, "plan").expect("a good plan");
            let told = (plan.contact_needs(), plan.between_arms_needs());
            assert_eq!((told.0.is_empty(), told.1.is_empty()), (contact, between), "{told:?}");
        }
        let paper = Plan::parse(PAPER, "paper.toml").expect("a good plan").contact_needs();
        assert!(paper[0].contains("specimen A (grouping 5)"), "{paper:?}");
        let blind = CONTACT.replace("name = \"LDV_A\"", "name = \"camera\"");
        let needs = Plan::parse(&blind, "plan").expect("a good plan").contact_needs();
        assert!(needs.len() == 1 && needs[0].contains("LDV_A"), "{needs:?}");
    }
}
