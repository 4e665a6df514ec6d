//! Operations as JSON: `["mul", 0, 1]`.

use crate::operation::{BINARY, Operation, UNARY};
use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, SeqAccess, Visitor};
use serde::ser::{SerializeSeq, SerializeTuple, Serializer};
use serde::{Serialize, ser};
use serde_json::Number;
use std::fmt;

/// A program is no longer than this.
pub(crate) const MOST_OPERATIONS: usize = 100_000;
/// No operation takes more arguments.
const MOST_ARGUMENTS: usize = 2;

pub(crate) fn serialize<S: Serializer>(
    operations: &[Operation],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut list = serializer.serialize_seq(Some(operations.len()))?;
    for operation in operations {
        list.serialize_element(&Written(operation))?;
    }
    list.end()
}

/// One operation as an array.
struct Written<'a>(&'a Operation);

impl Serialize for Written<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let name = self.0.name();
        match *self.0 {
            Operation::Constant(value) if !value.is_finite() => {
                Err(ser::Error::custom("a constant that is not finite"))
            }
            Operation::Constant(value) => (name, value).serialize(serializer),
            Operation::State(index)
            | Operation::Input(index)
            | Operation::Parameter(index)
            | Operation::Scheduling(index)
            | Operation::Unary(_, index) => (name, index).serialize(serializer),
            Operation::Binary(_, first, second) => {
                let mut array = serializer.serialize_tuple(3)?;
                array.serialize_element(name)?;
                array.serialize_element(&first)?;
                array.serialize_element(&second)?;
                array.end()
            }
        }
    }
}

pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<Operation>, D::Error> {
    deserializer.deserialize_seq(Operations)
}

struct Operations;

impl<'de> Visitor<'de> for Operations {
    type Value = Vec<Operation>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a list of operations, such as [\"mul\", 0, 1]")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut operations = Vec::new();
        while let Some(operation) = list.next_element_seed(Place(operations.len()))? {
            operations.push(operation);
        }
        Ok(operations)
    }
}

/// The operation of this index.
struct Place(usize);

impl<'de> DeserializeSeed<'de> for Place {
    type Value = Operation;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Operation, D::Error> {
        if self.0 >= MOST_OPERATIONS {
            let fault = format!("operations: more than {MOST_OPERATIONS}");
            return Err(D::Error::custom(fault));
        }
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Place {
    type Value = Operation;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "operation {} as an array of a name and numbers, such as [\"mul\", 0, 1]",
            self.0
        )
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut array: A) -> Result<Operation, A::Error> {
        let name: Option<String> = array.next_element()?;
        let mut arguments = Vec::with_capacity(MOST_ARGUMENTS);
        let mut found = 0;
        while found < MOST_ARGUMENTS {
            match array.next_element::<Number>()? {
                Some(argument) => arguments.push(argument),
                None => break,
            }
            found += 1;
        }
        while array.next_element::<IgnoredAny>()?.is_some() {
            found += 1;
        }
        let name = name.unwrap_or_default();
        parse(&name, &arguments, found)
            .map_err(|fault| A::Error::custom(format!("operation {}: {fault}", self.0)))
    }
}

/// The operation of this name with the first of `found` arguments.
fn parse(name: &str, arguments: &[Number], found: usize) -> Result<Operation, String> {
    let takes = |count: usize| {
        if found == count {
            return Ok(());
        }
        let (count, noun) = match count {
            1 => ("one", "argument"),
            _ => ("two", "arguments"),
        };
        Err(format!("{name} takes {count} {noun}, found {found}"))
    };
    let index = |argument: &Number| {
        let index = argument.as_u64().and_then(|index| index.try_into().ok());
        index.ok_or_else(|| format!("{name} of {argument}, which is no index from 0 on"))
    };
    let leaf = match name {
        "state" => Some(Operation::State as fn(usize) -> Operation),
        "input" => Some(Operation::Input as _),
        "parameter" => Some(Operation::Parameter as _),
        "scheduling" => Some(Operation::Scheduling as _),
        _ => None,
    };
    if let Some(leaf) = leaf {
        takes(1)?;
        return Ok(leaf(index(&arguments[0])?));
    }
    if name == "constant" {
        takes(1)?;
        let value = arguments[0].as_f64().filter(|value| value.is_finite());
        let value =
            value.ok_or_else(|| format!("the constant {} is no finite number", arguments[0]))?;
        return Ok(Operation::Constant(value));
    }
    if let Some((_, function)) = UNARY.iter().find(|(known, _)| *known == name) {
        takes(1)?;
        return Ok(Operation::Unary(*function, index(&arguments[0])?));
    }
    if let Some((_, function)) = BINARY.iter().find(|(known, _)| *known == name) {
        takes(2)?;
        return Ok(Operation::Binary(
            *function,
            index(&arguments[0])?,
            index(&arguments[1])?,
        ));
    }
    let leaves = ["constant", "state", "input", "parameter", "scheduling"];
    let unary = UNARY.iter().map(|(name, _)| *name);
    let known: Vec<&str> = { leaves.into_iter().chain(unary) }
        .chain(BINARY.iter().map(|(name, _)| *name))
        .collect();
    let shown: String = name.chars().take(40).collect();
    Err(format!(
        "{shown:?} is no operation; there are {}",
        known.join(", ")
    ))
}
